"""A drive on the terminal."""

import time
from collections import deque
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from rich.console import Console, RenderableType

from surefix import Fix, Localizer, Map
from surefix.live.paced import PacedLive
from surefix.live.references import References
from surefix.live.route_bar import RouteBar
from surefix.live.terminal_panel import Row, Scene, panel
from surefix.live.totals import Totals
from surefix.live.view import Seen

__all__ = ["TerminalView"]


class TerminalView:
    """Where on the route the drive is, the distances with their minimum and gradient peak, the
    newest fixes, how many are trusted, latency and dropped frames; on a large terminal, also what
    the camera sees and what it is matched to.

    It is drawn a few times a second, however fast the fixes come, and takes the room that the
    terminal has. Where there is no terminal, it writes a plain line a fix.

    Parameters
    ----------
    map : Map
        The localizer's map.
    total : int, optional
        How many frames there will be, where that is known.
    references : path, optional
        The folder of the map's images, as for ``References``.
    console : rich.console.Console, optional
        Where to draw: standard output by default.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> from surefix.live import TerminalView
    >>> route = surefix.Map.from_descriptors(np.eye(4, dtype=np.float32))
    >>> localizer = surefix.Localizer(route)
    >>> with TerminalView(route) as view:
    ...     fix = localizer.push(np.float32([0.1, 1, 0.1, 0]))
    ...     view.update(np.float32([0.1, 1, 0.1, 0]), fix, localizer, latency_us=12.0)
    frame 0: place 1, score 0.010, trusted, warming up
    """

    PAUSE = 1 / 10
    KEPT = 20

    def __init__(
        self,
        map: Map,
        *,
        total: int | None = None,
        references: str | Path | None = None,
        console: Console | None = None,
    ) -> None:
        self.console = console or Console()
        self.names = map.names
        self.total = total
        self.references = References(map, references)
        self.route = RouteBar(len(map))
        self.places = len(map)
        self.totals = Totals()
        self.rows: deque[Row] = deque(maxlen=self.KEPT)
        self.newest: tuple[Seen, Fix] | None = None
        self.distances = np.zeros(len(map), np.float32)
        self.paced = PacedLive(self.console, self.PAUSE)
        self.paced.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def update(self, frame: Any, fix: Fix, localizer: Localizer, latency_us: float) -> None:
        """Take one frame and its fix, and draw them if it is time to; as ``View.update``."""
        seen = Seen.of(frame, fix)
        row = Row(seen.name, fix, self._name(fix.place), latency_us)
        if not self.paced.on:
            self.console.print(row.line(), markup=False, highlight=False, soft_wrap=True)
            return
        with self.paced.lock:
            self.totals.add(seen, fix, latency_us, time.monotonic())
            self.route.add(fix)
            self.rows.append(row)
            self.newest = seen, fix
            # Those that a screen spares the push are asked for only where they are drawn at once.
            if localizer.map.screen is None or self.paced.is_due:
                self.distances = localizer.distances
        self.paced.draw(self._picture)

    def close(self) -> None:
        """Draw for the last time, and give the terminal back. Once more does nothing."""
        self.paced.stop(None if self.newest is None else self._picture)

    def _name(self, place: int) -> str:
        """What the map calls a place, where that says more than its number."""
        name = self.names[place] if self.names else ""
        return "" if name == str(place) else name

    def _picture(self) -> RenderableType:
        assert self.newest is not None
        seen, fix = self.newest
        scene = Scene(
            places=self.places,
            total=self.total,
            fix=fix,
            image=seen.image,
            reference=self.references.image(fix.place),
            distances=self.distances,
            route=self.route,
            rows=list(self.rows),
            totals=self.totals,
        )
        return panel(scene, self.console)
