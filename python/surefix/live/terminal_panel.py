"""One picture of a drive, as large as the terminal."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rich.console import Console, Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from surefix import Fix
from surefix.live.colours import MINIMUM, PEAK, TRUSTED
from surefix.live.half_blocks import HalfBlocks
from surefix.live.route_bar import RouteBar
from surefix.live.sparkline import sparkline
from surefix.live.strip import Strip
from surefix.live.totals import Totals

__all__ = ["Row", "Scene", "panel"]

WIDEST = 110
# From here on the fixes have these columns, too.
SCORES, LATENCIES, ANCHORS, NAMES = 34, 46, 58, 72


@dataclass(frozen=True, slots=True)
class Row:
    """A fix among the newest ones."""

    query: str
    fix: Fix
    place_name: str
    latency_us: float

    def line(self) -> str:
        """In words, for where there is no terminal."""
        fix = self.fix
        place = f"place {fix.place}" + (f" ({self.place_name})" if self.place_name else "")
        query = "" if self.query == str(fix.frame) else f" ({self.query})"
        parts = [place, f"score {fix.score:.3f}", "trusted" if fix.trusted else "not trusted"]
        parts += ["warming up"] if fix.sequence is None else []
        return f"frame {fix.frame}{query}: {', '.join(parts)}"


@dataclass(frozen=True, slots=True)
class Scene:
    """All that one picture shows."""

    places: int
    total: int | None
    fix: Fix
    image: NDArray[np.uint8] | None
    reference: NDArray[np.uint8] | None
    distances: NDArray[np.float32]
    route: RouteBar
    rows: list[Row]
    totals: Totals


def panel(scene: Scene, console: Console) -> RenderableType:
    """The scene, with what the console has room for: first of all where the drive is, last of all
    its images.
    """
    unicode = (console.encoding or "").lower().startswith("utf")
    width = min(console.width, WIDEST)
    inside = max(1, width - 4)
    strip = Strip(scene.places, inside)
    # One line stays free for the cursor, and two are the frame's.
    room = console.height - 3
    top: list[RenderableType] = [_headline(scene, unicode)]
    below: list[RenderableType] = []
    summary = _lines(str(scene.totals), inside, unicode)[: max(0, room - 1)]
    room -= 1 + len(summary)
    if room >= 3:
        top += ["", scene.route.draw(strip, unicode)]
        room -= 3
    if room >= 6:
        lines = (3 if room >= 16 else 2) if unicode else 1
        below += [
            "",
            _distances_label(scene, unicode),
            sparkline(scene.distances, scene.fix, strip, lines, unicode),
        ]
        room -= 4 + lines
    if room >= 4:
        shown = min(len(scene.rows), room - 2, 12)
        below += ["", _table(scene.rows[len(scene.rows) - shown :], width, unicode)]
        room -= 2 + shown
    if (
        room >= 8
        and inside >= 40
        and unicode
        and not console.no_color
        and console.color_system in ("truecolor", "256")
    ):
        top += _images(scene, inside, min(room - 2, 16))
    body = Group(*top, *below, *(["", *summary] if room >= 1 else summary))
    of = "" if scene.total is None else f" of {scene.total}"
    title = Text(f"frame {scene.fix.frame + 1}{of}", "bold")
    return Panel(body, title=title, title_align="left", width=width, border_style="dim")


def _headline(scene: Scene, unicode: bool) -> Text:
    fix, row = scene.fix, scene.rows[-1]
    text = Text(no_wrap=True, overflow="ellipsis")
    mark, word, style = _trust(fix, unicode)
    text.append(f"{mark} place {fix.place}", f"bold {style}")
    text.append(f" of {scene.places}", "dim")
    text.append(f"  {word}", style)
    text.append(f"  score {fix.score:.3f}")
    if fix.sequence is None:
        text.append("  warming up", "dim")
    if row.place_name:
        text.append(f"  {row.place_name}", "dim")
    return text


def _trust(fix: Fix, unicode: bool) -> tuple[str, str, str]:
    if fix.trusted:
        return ("●" if unicode else "#"), "trusted", TRUSTED
    return ("○" if unicode else "o"), "not trusted", "dim"


def _distances_label(scene: Scene, unicode: bool) -> Text:
    fix = scene.fix
    text = Text("distances: ", "dim", no_wrap=True, overflow="ellipsis")
    text.append("▲ " if unicode else "^ ", f"bold {MINIMUM}")
    text.append(f"smallest {fix.single.distance:.3f} at {fix.single.place}, ")
    text.append("▼ " if unicode else "v ", f"bold {PEAK}")
    text.append(f"gradient {fix.gradient.value:.3f} at {fix.gradient.place}")
    return text


def _images(scene: Scene, inside: int, lines: int) -> list[RenderableType]:
    images = [image for image in (scene.image, scene.reference) if image is not None]
    if not images:
        return []
    pair = Table.grid(padding=(0, 2, 0, 0))
    pair.add_row(*(HalfBlocks(image, (inside - 2) // 2, lines) for image in images))
    return ["", pair]


def _table(rows: list[Row], width: int, unicode: bool) -> Table:
    table = Table(box=None, header_style="dim", padding=(0, 2, 0, 0), pad_edge=False)
    table.add_column("frame", justify="right", no_wrap=True)
    named = width >= NAMES and any(row.query != str(row.fix.frame) for row in rows)
    if named:
        table.add_column("query", no_wrap=True, overflow="ellipsis", max_width=20)
    table.add_column("place", justify="right", no_wrap=True)
    if width >= SCORES:
        table.add_column("score", justify="right", no_wrap=True)
    if width >= LATENCIES:
        table.add_column("us", justify="right", no_wrap=True)
    table.add_column("fix", no_wrap=True)
    if width >= ANCHORS:
        table.add_column("anchors", justify="right", no_wrap=True)
    for row in rows:
        fix = row.fix
        mark, word, style = _trust(fix, unicode)
        cells: list[RenderableType] = [str(fix.frame)]
        cells += [Text(row.query)] if named else []
        cells.append(str(fix.place))
        cells += [f"{fix.score:.3f}"] if width >= SCORES else []
        cells += [f"{row.latency_us:.0f}"] if width >= LATENCIES else []
        cells.append(Text(f"{mark} {word}" if width >= SCORES else mark, style))
        if width >= ANCHORS:
            cells.append(
                Text("warming up", "dim") if fix.sequence is None else str(fix.sequence.anchors)
            )
        table.add_row(*cells)
    return table


def _lines(words: str, width: int, unicode: bool) -> list[Text]:
    """Parts with points between, in as few lines as they fit."""
    lines: list[str] = []
    between = " · " if unicode else " | "
    for part in words.split(" · "):
        if lines and len(lines[-1]) + 3 + len(part) <= width:
            lines[-1] += between + part
        else:
            lines.append(part)
    return [Text(line, "dim", no_wrap=True, overflow="ellipsis") for line in lines]
