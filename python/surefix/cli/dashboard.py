"""The demo's drive as it goes, on a terminal."""

import sys
from collections import Counter, deque
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray
from rich.console import Console, Group
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from surefix import Fix
from surefix.live.half_blocks import HalfBlocks
from surefix.live.paced import PacedLive
from surefix.plot.outcome import Outcome
from surefix.simulate import Traverse

__all__ = ["Dashboard"]

Image = NDArray[np.uint8]

COLOURS = {
    Outcome.TRUSTED_RIGHT: "bold #3d9be0",
    Outcome.TRUSTED_WRONG: "bold #e8641b",
    Outcome.UNTRUSTED_RIGHT: "#5f8fb3",
    Outcome.UNTRUSTED_WRONG: "#a5834f",
}


class Dashboard:
    """What the camera sees and what it is matched to, the route so far, the newest fixes, and a
    tally.

    Used as a context. Drawn between two pushes, never beside one, so that it does not slow what it
    shows. Where standard error is no terminal, it shows nothing.
    """

    WIDTH = 84
    SHOWN = 6
    PAUSE = 1 / 15

    def __init__(self, reference: Traverse, total: int) -> None:
        self.console = Console(stderr=True, force_terminal=sys.stderr.isatty())
        self.paced = PacedLive(self.console, self.PAUSE)
        self.reference = reference
        self.total = total
        self.image: Image | None = None
        self.fixes: deque[tuple[Fix, int, Outcome, float]] = deque(maxlen=self.SHOWN)
        self.counts: Counter[Outcome] = Counter()
        self.latency: list[float] = []
        self.width = min(self.WIDTH, self.console.width)
        self.route: list[Counter[Outcome]] = [
            Counter() for _ in range(min(max(8, self.width - 4), total))
        ]
        encoding = (self.console.encoding or "").lower()
        self.unicode = encoding.startswith("utf")
        marks = ("●", "✖", "○", "·") if self.unicode else ("o", "X", "o", "x")
        self.marks = dict(zip(Outcome, marks, strict=True))
        roomy = self.width >= 40 and self.console.height >= 32
        self.pictures = self.unicode and roomy and self.console.color_system in ("truecolor", "256")

    def __enter__(self) -> Self:
        self.paced.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.paced.stop(self._panel)

    def show(self, image: Image, fix: Fix, truth: int, right: bool, latency: float) -> None:
        """Take one fix, and draw it if it is time to."""
        if not self.paced.on:
            return
        outcome = Outcome.of(right, fix.trusted)
        with self.paced.lock:
            self.image = image
            self.counts[outcome] += 1
            self.route[fix.frame * len(self.route) // self.total][outcome] += 1
            self.fixes.append((fix, truth, outcome, latency))
            self.latency.append(latency)
        self.paced.draw(self._panel)

    def _panel(self) -> Panel:
        parts = [self._pictures()] if self.pictures and self.fixes else []
        body = Group(*parts, self._route(), "", self._table(), "", self._legend(), self._summary())
        title = "Localizing: a winter afternoon on a map of summer"
        return Panel(body, title=title, title_align="left", width=self.width, border_style="dim")

    def _pictures(self) -> Table:
        """The newest frame, and the place it was matched to."""
        fix, _, outcome, _ = self.fixes[-1]
        wide = (self.width - 6) // 2
        pair = Table.grid(padding=(0, 2, 0, 0))
        if self.image is not None:
            pair.add_row(HalfBlocks(self.image, wide), HalfBlocks(self.reference[fix.place], wide))
        answer = Text(
            f"map, place {fix.place}: {self.marks[outcome]} {outcome.value}", COLOURS[outcome]
        )
        pair.add_row(Text(f"camera, frame {fix.frame}", "dim"), answer)
        pair.add_row("")
        return pair

    def _route(self) -> Text:
        """The route from start to end: what a robot that acts on trusted fixes knew in each part of
        it.
        """
        text = Text()
        block, passed, ahead = "█░·" if self.unicode else "#.."
        for part in self.route:
            if part[Outcome.TRUSTED_WRONG]:
                text.append(self.marks[Outcome.TRUSTED_WRONG], COLOURS[Outcome.TRUSTED_WRONG])
            elif part[Outcome.TRUSTED_RIGHT]:
                text.append(block, COLOURS[Outcome.TRUSTED_RIGHT])
            else:
                text.append(passed if part else ahead, "dim")
        return text

    def _table(self) -> Table:
        table = Table(box=None, header_style="dim", padding=(0, 2, 0, 0))
        for name in ("frame", "place", "truth", "score", "ms"):
            table.add_column(name, justify="right", min_width=6)
        table.add_column("fix")
        for fix, truth, outcome, latency in self.fixes:
            numbers = (
                str(fix.frame),
                str(fix.place),
                str(truth),
                f"{fix.score:.3f}",
                f"{latency * 1000:.2f}",
            )
            table.add_row(
                *numbers, Text(f"{self.marks[outcome]} {outcome.value}", COLOURS[outcome])
            )
        return table

    def _legend(self) -> Table:
        tally = Table.grid(padding=(0, 4, 0, 0))
        cells = [
            Text.assemble(
                (f"{self.marks[outcome]} {outcome.value} ", COLOURS[outcome]),
                str(self.counts[outcome]),
            )
            for outcome in Outcome
        ]
        tally.add_row(*cells[:2])
        tally.add_row(*cells[2:])
        return tally

    def _summary(self) -> Text:
        right, wrong = self.counts[Outcome.TRUSTED_RIGHT], self.counts[Outcome.TRUSTED_WRONG]
        share = (
            f"{right / (right + wrong):.0%} of the trusted right"
            if right + wrong
            else "none trusted yet"
        )
        median = 1000 * float(np.median(self.latency)) if self.latency else 0.0
        done = sum(self.counts.values())
        return Text(
            f"{done} of {self.total} frames, {share}, {median:.2f} ms a fix (median)", "dim"
        )
