"""A picture on a terminal that is drawn anew now and then, and never takes most of the time."""

import time
from collections.abc import Callable
from threading import Lock, Timer

from rich.console import Console, RenderableType
from rich.live import Live

__all__ = ["PacedLive"]


class PacedLive:
    """Drawn between two pushes, so that it does not slow what it shows; where none follows, a
    little later.

    What ``picture`` looks at may change under ``lock`` only.

    Parameters
    ----------
    console : Console
        Where it is drawn. Where that is no terminal, nothing is.
    pause : float
        Seconds between two drawings, at least.
    """

    def __init__(self, console: Console, pause: float) -> None:
        self.on = console.is_terminal and not console.is_dumb_terminal
        self.live = Live(console=console, auto_refresh=False)
        self.pause = pause
        self.due = 0.0
        self.lock = Lock()
        self.late: Timer | None = None

    def start(self) -> None:
        """Take the terminal."""
        if self.on:
            self.live.start()

    @property
    def is_due(self) -> bool:
        """Whether ``draw`` would draw now."""
        return self.on and time.perf_counter() >= self.due

    def draw(self, picture: Callable[[], RenderableType]) -> None:
        """Draw what ``picture`` gives, or the next one; at the latest when it is time to."""
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
            # It may have been stopped, or the next frame been drawn, while this waited for the
            # lock.
            if self.late is None:
                return
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
        """Draw for the last time, and give the terminal back: what is drawn stays, and the cursor
        stands below it.
        """
        if not self.on or not self.live.is_started:
            return
        with self.lock:
            self._nothing_late()
            try:
                if picture is not None:
                    self.live.update(picture())
            finally:
                # Which draws it.
                self.live.stop()
