"""How the command line writes fixes: as CSV, as JSON lines, or live on a terminal."""

import csv
import json
from collections import deque
from dataclasses import asdict, dataclass
from types import TracebackType
from typing import Any, Self, TextIO

from rich.console import Group
from rich.live import Live
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from surefix import Fix

__all__ = ["CsvFixes", "FixRow", "JsonFixes", "LiveFixes", "Moment"]


@dataclass(frozen=True)
class FixRow:
    """A fix, with the names of its query and place, and how long it took in microseconds.

    ``moment`` is there where frames come from a stream that says when they were taken, and what is missing before them.
    """

    query: str
    fix: Fix
    place_name: str | None
    latency_us: float
    moment: "Moment | None" = None

    def fields(self) -> dict[str, Any]:
        """The row's columns; None where there is nothing (yet)."""
        fix, sequence = self.fix, self.fix.sequence
        when = {} if self.moment is None else asdict(self.moment)
        return {
            "frame": fix.frame,
            "query": self.query,
            "place": fix.place,
            "place_name": self.place_name,
            "score": fix.score,
            "trusted": fix.trusted,
            "ready": sequence is not None,
            "anchors": None if sequence is None else sequence.anchors,
            "speed": None if sequence is None else sequence.speed,
            "single_place": fix.single.place,
            "single_distance": fix.single.distance,
            "gradient_place": fix.gradient.place,
            "gradient_value": fix.gradient.value,
            "latency_us": round(self.latency_us, 1),
            **when,
        }


@dataclass(frozen=True)
class Moment:
    """When a frame was taken, in seconds; how many were dropped before it; and whether time is missing there."""

    time: float | None
    dropped: int
    gap: bool


class _Writer:
    """Writes rows as they come. Used as a context."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        return None

    def write(self, row: FixRow) -> None:
        """Take one row."""


class CsvFixes(_Writer):
    """A line of names, then a line a fix; booleans in lower case, an empty field where there is nothing."""

    def __init__(self, file: TextIO) -> None:
        self.file = file
        self.writer: csv.DictWriter[str] | None = None

    def write(self, row: FixRow) -> None:
        """Write one line."""
        fields = row.fields()
        if self.writer is None:
            self.writer = csv.DictWriter(self.file, list(fields), lineterminator="\n")
            self.writer.writeheader()
        self.writer.writerow({k: str(v).lower() if isinstance(v, bool) else v for k, v in fields.items()})
        self.file.flush()


class JsonFixes(_Writer):
    """One JSON object a line."""

    def __init__(self, file: TextIO) -> None:
        self.file = file

    def write(self, row: FixRow) -> None:
        """Write one line."""
        self.file.write(json.dumps(row.fields()) + "\n")
        self.file.flush()


class LiveFixes(_Writer):
    """The newest fixes in a table that moves with the drive, and a bar; ``beside`` gets each row too."""

    SHOWN = 12

    def __init__(self, total: int | None, beside: _Writer | None) -> None:
        self.beside = beside
        self.rows: deque[FixRow] = deque(maxlen=self.SHOWN)
        last = TimeElapsedColumn() if total is None else TimeRemainingColumn()
        columns = (TextColumn("Localizing"), BarColumn(), MofNCompleteColumn(), last)
        self.progress = Progress(*columns)
        self.task = self.progress.add_task("run", total=total)
        self.live = Live(get_renderable=self._picture, refresh_per_second=12, transient=False)

    def __enter__(self) -> Self:
        self.live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.live.stop()

    def write(self, row: FixRow) -> None:
        """Show one row."""
        self.rows.append(row)
        self.progress.advance(self.task)
        if self.beside is not None:
            self.beside.write(row)

    def _picture(self) -> Group:
        table = Table(box=None, header_style="dim", padding=(0, 2, 0, 0))
        for name in ("frame", "query", "place", "", "score", "trusted", "anchors", "us"):
            table.add_column(name, justify="left" if name in ("query", "", "trusted") else "right")
        for row in list(self.rows):
            fix = row.fix
            trusted = Text("● trusted", "bold green") if fix.trusted else Text("○", "dim")
            anchors = "warming up" if fix.sequence is None else str(fix.sequence.anchors)
            table.add_row(
                str(fix.frame),
                _query(row),
                str(fix.place),
                Text(row.place_name or "", "dim"),
                f"{fix.score:.3f}",
                trusted,
                anchors,
                f"{row.latency_us:.0f}",
            )
        return Group(table, self.progress)


def _query(row: FixRow) -> Text:
    """Its name, and what is missing before it."""
    text = Text(row.query)
    if row.moment is not None and row.moment.dropped:
        text.append(f" {row.moment.dropped} dropped", "yellow")
    if row.moment is not None and row.moment.gap:
        text.append(" gap", "yellow")
    return text
