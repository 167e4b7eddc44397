"""One picture of a drive, as large as the terminal."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from rich.color import Color
from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.measure import Measurement
from rich.panel import Panel
from rich.segment import Segment
from rich.style import Style
from rich.table import Table
from rich.text import Text

from surefix import Fix
from surefix.live.binning import Bins
from surefix.live.view import HERE, MINIMUM, PEAK, TRUSTED, Image
from surefix.motion import PERHAPS_OFF

__all__ = ["HalfBlocks", "RouteBar", "Row", "Scene", "panel"]

WIDEST = 110
# From these widths on the fixes have these columns, too.
SCORES, LATENCIES, ANCHORS, NAMES = 34, 46, 58, 72

BLOCKS = " ▁▂▃▄▅▆▇█"
PLAIN = "_.:-=+*#"
# A place of the route: not reached, matched, or matched and trusted.
AHEAD, PASSED, KNOWN = 0, 1, 2
# The start of a segment.
EDGE = "│"


@dataclass(frozen=True, slots=True)
class Row:
    """A fix among the newest ones."""

    query: str
    fix: Fix
    place_name: str
    latency_us: float
    place: str

    def line(self) -> str:
        """In words, for output that is no terminal."""
        fix = self.fix
        place = self.place + (f" ({self.place_name})" if self.place_name else "")
        query = "" if self.query == str(fix.frame) else f" ({self.query})"
        parts = [place, _sure(fix), "trusted" if fix.trusted else "not trusted"]
        parts += _state(fix)
        return f"frame {fix.frame}{query}: {', '.join(parts)}"


class RouteBar:
    """The map's places in order: trusted fixes were here, others were there, the rest is unseen."""

    def __init__(self, places: int, breaks: Sequence[int] = ()) -> None:
        self.state = np.zeros(places, np.uint8)
        self.breaks = breaks
        self.here = 0

    def add(self, fix: Fix) -> None:
        """Take one fix."""
        self.here = fix.place
        self.state[fix.place] = max(int(self.state[fix.place]), KNOWN if fix.trusted else PASSED)

    def draw(self, bins: Bins, unicode: bool) -> Text:
        """The bar, and below it an arrow to the newest fix."""
        marks = "·░█" if unicode else ".-#"
        text = Text(no_wrap=True, overflow="crop")
        drawn = bins.largest(self.state).tolist()
        # Between segments a line, unless there were hardly anything else.
        few = 4 * len(self.breaks) <= len(drawn)
        ends = {bins.of(place) for place in self.breaks} if few else set()
        for at, state in enumerate(drawn):
            style = TRUSTED if state == KNOWN else "dim"
            text.append((EDGE if unicode else "|") if at in ends else marks[state], style)
        text.append("\n" + " " * bins.of(self.here))
        text.append("▲" if unicode else "^", "bold")
        return text


class HalfBlocks:
    """An image in characters that are half foreground and half background: two pixels each.

    Parameters
    ----------
    image : uint8 array, (H, W) or (H, W, 3)
    width, lines : int
        The most characters across and down.
    """

    def __init__(self, image: Image, width: int, lines: int) -> None:
        if image.ndim == 2:
            image = np.repeat(image[:, :, None], 3, axis=2)
        tall, wide = image.shape[:2]
        self.width = min(width, max(1, 2 * lines * wide // tall), wide)
        height = min(tall, max(2, round(self.width * tall / wide) // 2 * 2))
        rows = np.arange(height) * tall // height
        columns = np.arange(self.width) * wide // self.width
        sums = np.add.reduceat(image, rows, axis=0, dtype=np.int64)
        sums = np.add.reduceat(sums, columns, axis=1)
        heights, widths = np.diff(rows, append=tall), np.diff(columns, append=wide)
        self.pixels = (sums // np.outer(heights, widths)[:, :, None]).tolist()

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for upper, lower in zip(self.pixels[::2], self.pixels[1::2], strict=False):
            for above, below in zip(upper, lower, strict=True):
                style = Style(color=Color.from_rgb(*above), bgcolor=Color.from_rgb(*below))
                yield Segment("▀", style)
            yield Segment.line()

    def __rich_measure__(self, console: Console, options: ConsoleOptions) -> Measurement:
        return Measurement(self.width, self.width)


@dataclass(frozen=True, slots=True)
class Scene:
    """All that one picture shows."""

    total: int | None
    fix: Fix
    image: Image | None
    reference: Image | None
    distances: NDArray[np.float32]
    belief: NDArray[np.float64] | None
    route: RouteBar
    rows: list[Row]
    totals: str


def panel(scene: Scene, console: Console, spare: int = 0) -> RenderableType:
    """The scene, as far as the console has room: first of all the place, last of all the images.

    ``spare`` lines stay free below, and one for the cursor.
    """
    unicode = (console.encoding or "").lower().startswith("utf")
    width = min(console.width, WIDEST)
    inside = max(1, width - 4)
    bins = Bins(len(scene.distances), inside, fill=True)
    # One line stays free for the cursor, and two are the frame's.
    room = console.height - 3 - spare
    top: list[RenderableType] = [_headline(scene, unicode)]
    below: list[RenderableType] = []
    summary = _lines(scene.totals, inside, unicode)[: max(0, room - 1)]
    room -= 1 + len(summary)
    if room >= 3:
        top.append("")
        room -= 3
        if scene.belief is not None and room >= 2:
            top += [_belief_label(scene.fix), _strip(scene.belief, bins, unicode)]
            room -= 2
        top.append(scene.route.draw(bins, unicode))
    if room >= 6:
        lines = (3 if room >= 16 else 2) if unicode else 1
        bars = _bars(scene.distances, scene.fix, bins, lines, unicode)
        below += ["", _distances_label(scene, unicode), bars]
        room -= 4 + lines
    if room >= 4:
        shown = min(len(scene.rows), room - 2, 12)
        below += ["", _table(scene.rows[len(scene.rows) - shown :], width, unicode)]
        room -= 2 + shown
    colours = not console.no_color and console.color_system in ("truecolor", "256")
    images = [image for image in (scene.image, scene.reference) if image is not None]
    if room >= 8 and inside >= 40 and unicode and colours and images:
        pair = Table.grid(padding=(0, 2, 0, 0))
        size = (inside - 2) // 2, min(room - 2, 16)
        pair.add_row(*(HalfBlocks(image, *size) for image in images))
        top += ["", pair]
    body = Group(*top, *below, *(["", *summary] if room >= 1 else summary))
    of = "" if scene.total is None else f" of {scene.total}"
    title = Text(f"frame {scene.fix.frame + 1}{of}", "bold")
    return Panel(body, title=title, title_align="left", width=width, border_style="dim")


def _headline(scene: Scene, unicode: bool) -> Text:
    fix, row = scene.fix, scene.rows[-1]
    text = Text(no_wrap=True, overflow="ellipsis")
    mark, word, style = _trust(fix, unicode)
    text.append(f"{mark} {row.place}", f"bold {style}")
    of = f"of {len(scene.distances)}"
    numbered = row.place == f"place {fix.place}"
    text.append(f" {of}" if numbered else f" ({fix.place} {of})", "dim")
    said = [(word, style), (_sure(fix), "")]
    # The mark says trust, too, if there is no room for the word.
    for words, style in said if fix.track is None else reversed(said):
        text.append(f"  {words}", style)
    for state in _state(fix):
        text.append(f"  {state}", "dim")
    if row.place_name:
        text.append(f"  {row.place_name}", "dim")
    return text


def _sure(fix: Fix) -> str:
    """The confidence if there is a track, else the score."""
    if fix.track is None:
        return f"score {fix.score:.3f}"
    return f"confidence {fix.track.confidence:.2f}"


def _state(fix: Fix) -> list[str]:
    """A word for a fix that may be no place: without a sequence yet, or off the map."""
    if fix.track is None:
        return ["warming up"] if fix.sequence is None else []
    return ["perhaps off the map"] if fix.track.off_map > PERHAPS_OFF else []


def _trust(fix: Fix, unicode: bool) -> tuple[str, str, str]:
    if fix.trusted:
        return ("●" if unicode else "#"), "trusted", TRUSTED
    return ("○" if unicode else "o"), "not trusted", "dim"


def _belief_label(fix: Fix) -> Text:
    assert fix.track is not None
    low, high = fix.track.interval
    text = Text("belief: ", "dim", no_wrap=True, overflow="ellipsis")
    text.append(f"95 % at {low}-{high}, off map {fix.track.off_map:.2f}")
    return text


def _strip(belief: NDArray[np.float64], bins: Bins, unicode: bool) -> Text:
    """The belief along the route, a character a bin: its square root, as a belief that is spread
    over the route could not be seen beside one place's.
    """
    marks = BLOCKS if unicode else " " + PLAIN
    heights = np.rint(np.sqrt(bins.sums(belief).clip(0, 1)) * (len(marks) - 1)).astype(int)
    return Text("".join(marks[height] for height in heights), HERE, no_wrap=True, overflow="crop")


def _distances_label(scene: Scene, unicode: bool) -> Text:
    fix = scene.fix
    text = Text("distances: ", "dim", no_wrap=True, overflow="ellipsis")
    text.append("▲ " if unicode else "^ ", f"bold {MINIMUM}")
    text.append(f"smallest {fix.single.distance:.3f} at {fix.single.place}, ")
    text.append("▼ " if unicode else "v ", f"bold {PEAK}")
    text.append(f"gradient {fix.gradient.value:.3f} at {fix.gradient.place}")
    return text


def _bars(distances: NDArray[np.float32], fix: Fix, bins: Bins, lines: int, unicode: bool) -> Text:
    """Bars of the distances, pointed at by the gradient peak from above and by the minimum from
    below. If the two arrows point at each other, the match is trusted.
    """
    values = bins.smallest(distances)
    low, high = float(values.min()), float(values.max())
    share = (values - low) / (high - low) if high > low else np.ones(len(values))
    text = Text(no_wrap=True, overflow="crop")
    text.append(" " * bins.of(fix.gradient.place))
    text.append("▼\n" if unicode else "v\n", f"bold {PEAK}")
    if unicode:
        # The smallest still has a bar: an eighth of a line.
        eighths = 1 + np.rint(share * (8 * lines - 1)).astype(int)
        levels = [np.clip(eighths - 8 * line, 0, 8) for line in reversed(range(lines))]
    else:
        levels = [np.rint(share * (len(PLAIN) - 1)).astype(int)]
    for line in levels:
        text.append("".join((BLOCKS if unicode else PLAIN)[level] for level in line) + "\n", "dim")
    text.append(" " * bins.of(fix.single.place))
    text.append("▲" if unicode else "^", f"bold {MINIMUM}")
    return text


def _table(rows: list[Row], width: int, unicode: bool) -> Table:
    table = Table(box=None, header_style="dim", padding=(0, 2, 0, 0), pad_edge=False)
    named = width >= NAMES and any(row.query != str(row.fix.frame) for row in rows)
    for row in rows:
        fix, sequence = row.fix, row.fix.sequence
        mark, word, style = _trust(fix, unicode)
        cells: dict[str, RenderableType] = {"frame": str(fix.frame)}
        if named:
            cells["query"] = Text(row.query)
        cells["place"] = str(fix.place)
        if width >= SCORES:
            name, number = _sure(fix).split()
            cells[name] = number
        if width >= LATENCIES:
            cells["us"] = f"{row.latency_us:.0f}"
        cells["fix"] = Text(f"{mark} {word}" if width >= SCORES else mark, style)
        if width >= ANCHORS:
            cells["anchors"] = str(sequence.anchors) if sequence else Text("warming up", "dim")
        for name in cells if not table.columns else ():
            words, most = name in ("query", "fix"), 20 if name == "query" else None
            side: Literal["left", "right"] = "left" if words else "right"
            table.add_column(name, justify=side, no_wrap=True, max_width=most)
        table.add_row(*cells.values())
    return table


def _lines(words: str, width: int, unicode: bool) -> list[Text]:
    """Parts with points between, in the fewest lines that they fit."""
    lines: list[str] = []
    between = " · " if unicode else " | "
    for part in words.split(" · "):
        if lines and len(lines[-1]) + 3 + len(part) <= width:
            lines[-1] += between + part
        else:
            lines.append(part)
    return [Text(line, "dim", no_wrap=True, overflow="ellipsis") for line in lines]
