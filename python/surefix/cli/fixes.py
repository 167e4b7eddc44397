"""How the command line writes fixes: as CSV, or as JSON lines."""

import csv
import json
from dataclasses import asdict, dataclass
from typing import Any, TextIO

from surefix import Fix

__all__ = ["CsvFixes", "FixRow", "JsonFixes", "Moment"]


@dataclass(frozen=True)
class FixRow:
    """A fix, with the names of its query and place, and how long it took in microseconds.

    ``moment`` is there where frames come from a stream that says when they were taken, and what is
    missing before them.
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
    """When a frame was taken, in seconds; how many were dropped before it; and whether time is
    missing there.
    """

    time: float | None
    dropped: int
    gap: bool


class CsvFixes:
    """A line of names, then a line a fix; booleans in lower case, an empty field where there is
    nothing.
    """

    def __init__(self, file: TextIO) -> None:
        self.file = file
        self.writer: csv.DictWriter[str] | None = None

    def write(self, row: FixRow) -> None:
        """Write one line."""
        fields = row.fields()
        if self.writer is None:
            self.writer = csv.DictWriter(self.file, list(fields), lineterminator="\n")
            self.writer.writeheader()
        self.writer.writerow(
            {k: str(v).lower() if isinstance(v, bool) else v for k, v in fields.items()}
        )
        self.file.flush()


class JsonFixes:
    """One JSON object a line."""

    def __init__(self, file: TextIO) -> None:
        self.file = file

    def write(self, row: FixRow) -> None:
        """Write one line."""
        self.file.write(json.dumps(row.fields()) + "\n")
        self.file.flush()
