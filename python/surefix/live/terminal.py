"""A drive on the terminal."""

import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from threading import Lock, Timer
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console, RenderableType
from rich.live import Live

from surefix import Fix, Localizer, Map
from surefix._terminal import Console as PlainConsole
from surefix._words import place_in, plain, plural
from surefix.live.panel import RouteBar, Row, Scene, panel
from surefix.live.view import Closing, Images, References, Seen

__all__ = ["TerminalView"]


class TerminalView(Closing):
    """The place on the route, the belief along it if there is a track, the distances with their
    minimum and gradient peak, the newest fixes, the share that is trusted, latency and dropped
    frames; on a large terminal, also the camera's image and that of the matched place.

    It is drawn a few times a second, however fast the fixes come, and takes the room that the
    terminal has. If the output is no terminal, it writes a plain line a fix.

    Parameters
    ----------
    map : Map
        The localizer's map.
    total : int, optional
        The number of frames, if it is known.
    references : path or sequence of images, optional
        The folder of the map's images, or the images themselves. By default the map's thumbnails,
        else they are looked for by the names that the map has for its places.
    console : rich.console.Console, optional
        The output; standard output by default.
    spare : int
        How many lines the last picture leaves free below, for a summary that follows.

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
        references: str | Path | Images | None = None,
        console: Console | None = None,
        spare: int = 0,
    ) -> None:
        self.console = console or PlainConsole()
        self.spare = spare
        self.names = map.names
        self.total = total
        self.references = References(map, references)
        self.segments = map.segments
        self.route = RouteBar(len(map), self.segments.breaks.tolist())
        self.totals = Totals()
        self.rows: deque[Row] = deque(maxlen=self.KEPT)
        self.newest: tuple[Seen, Fix] | None = None
        self.distances = np.zeros(len(map), np.float32)
        self.belief: NDArray[np.float64] | None = None
        self.paced = PacedLive(self.console, self.PAUSE)

    def update(self, frame: Any, fix: Fix, localizer: Localizer, latency_us: float) -> None:
        """Take one frame and its fix, and draw them if it is time to; as ``View.update``."""
        seen = Seen.of(frame, fix)
        # The map's name of the place, if it says more than the number.
        name = self.names[fix.place] if self.names else ""
        name = "" if name == str(fix.place) else name
        where = place_in(self.segments, fix.place)
        row = Row(seen.name, fix, plain(name), latency_us, where)
        if not self.paced.on:
            self.console.print(row.line(), markup=False, highlight=False, soft_wrap=True)
            return
        with self.paced.lock:
            self.totals.add(seen, fix, latency_us, time.monotonic())
            self.route.add(fix)
            self.rows.append(row)
            self.newest = seen, fix
            # A screen spares the push most of them: then ask only for those that are drawn now.
            if localizer.map.screen is None or self.paced.is_due:
                self.distances = localizer.distances
                self.belief = localizer.belief
        self.paced.draw(self._picture)

    def close(self) -> None:
        """Draw for the last time, and give the terminal back. Calling it again does nothing."""
        self.paced.stop(None if self.newest is None else lambda: self._picture(self.spare))

    def _picture(self, spare: int = 0) -> RenderableType:
        assert self.newest is not None
        seen, fix = self.newest
        scene = Scene(
            total=self.total,
            fix=fix,
            image=seen.image,
            reference=self.references.image(fix.place),
            distances=self.distances,
            belief=self.belief,
            route=self.route,
            rows=list(self.rows),
            totals=str(self.totals),
        )
        return panel(scene, self.console, spare)


class Totals:
    """Counts since the start; latency and pace of the newest pushes. Its memory does not grow."""

    NEWEST = 1000

    def __init__(self) -> None:
        self.fixes = self.trusted = self.dropped = self.gaps = self.since_trusted = 0
        self.latency: deque[float] = deque(maxlen=self.NEWEST)
        self.times: deque[float] = deque(maxlen=61)

    def add(self, seen: Seen, fix: Fix, latency_us: float, now: float) -> None:
        """Take one frame and its fix; ``now`` in seconds, of any clock."""
        self.fixes += 1
        self.trusted += fix.trusted
        self.dropped += seen.dropped
        self.gaps += seen.gap
        self.since_trusted = 0 if fix.trusted else self.since_trusted + 1
        self.latency.append(latency_us)
        self.times.append(now)

    def __str__(self) -> str:
        """In words, with points between the parts."""
        p50, p99 = np.percentile(self.latency, (50, 99))
        parts = [f"{self.trusted / self.fixes:.0%} trusted ({self.trusted} of {self.fixes})"]
        if self.trusted and self.since_trusted:
            parts.append(f"the last trusted one {plural(self.since_trusted, 'frame')} ago")
        elapsed = self.times[-1] - self.times[0]
        if elapsed > 0:
            parts.append(f"{(len(self.times) - 1) / elapsed:.0f} frames a second")
        parts.append(f"{p50:.0f} us a push, p99 {p99:.0f}")
        gaps = f", {plural(self.gaps, 'gap')}" if self.gaps else ""
        return " · ".join([*parts, f"{self.dropped} dropped{gaps}"])


class PacedLive:
    """Takes a terminal for a picture, drawn between two pushes so that it does not slow the drive;
    if no push follows, a little later.

    Anything that ``picture`` reads may change under ``lock`` only.

    Parameters
    ----------
    console : Console
        If it is no terminal, nothing is drawn.
    pause : float
        The fewest seconds between two drawings.
    """

    def __init__(self, console: Console, pause: float) -> None:
        self.on = console.is_terminal and not console.is_dumb_terminal
        self.live = Live(console=console, auto_refresh=False)
        self.pause = pause
        self.due = 0.0
        self.lock = Lock()
        self.late: Timer | None = None
        if self.on:
            self.live.start()

    @property
    def is_due(self) -> bool:
        """Whether ``draw`` would draw now."""
        return self.on and time.perf_counter() >= self.due

    def draw(self, picture: Callable[[], RenderableType]) -> None:
        """Draw ``picture()`` if it is time to, and else when it is, unless a newer one comes."""
        if not self.on:
            return
        with self.lock:
            wait = self.due - time.perf_counter()
            if wait <= 0:
                self._draw(picture)
            elif self.late is None:
                self.late = Timer(wait, self._catch_up, (picture,))
                self.late.daemon = True
                self.late.start()

    def _catch_up(self, picture: Callable[[], RenderableType]) -> None:
        with self.lock:
            # While this waited for the lock, a newer picture may have been drawn, or all stopped.
            if self.late is not None:
                self._draw(picture)

    def _draw(self, picture: Callable[[], RenderableType]) -> None:
        start = time.perf_counter()
        self.live.update(picture(), refresh=True)
        end = time.perf_counter()
        # On a slow terminal, the drive has most of the time.
        self.due = end + max(self.pause, 2 * (end - start))
        self._nothing_late()

    def _nothing_late(self) -> None:
        if self.late is not None:
            self.late.cancel()
            self.late = None

    def stop(self, picture: Callable[[], RenderableType] | None) -> None:
        """Draw for the last time: the picture stays, and the cursor stands below it."""
        if not self.on or not self.live.is_started:
            return
        with self.lock:
            self._nothing_late()
            try:
                if picture is not None:
                    self.live.update(picture())
            finally:
                # This draws it.
                self.live.stop()
