"""A picture on a terminal that is drawn anew now and then, and never takes most of the time."""

import time
from collections.abc import Callable

from rich.console import Console, RenderableType
from rich.live import Live

__all__ = ["PacedLive"]


class PacedLive:
    """Drawn between two pushes, never beside one, so that it does not slow what it shows.

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

    def start(self) -> None:
        """Take the terminal."""
        if self.on:
            self.live.start()

    def draw(self, picture: Callable[[], RenderableType]) -> None:
        """Draw what ``picture`` gives, if it is time to."""
        start = time.perf_counter()
        if not self.on or start < self.due:
            return
        self.live.update(picture(), refresh=True)
        end = time.perf_counter()
        # On a slow terminal, the drive has most of the time.
        self.due = end + max(self.pause, 2 * (end - start))

    def stop(self, picture: Callable[[], RenderableType] | None) -> None:
        """Draw for the last time, and give the terminal back: what is drawn stays, and the cursor stands below it."""
        if not self.on or not self.live.is_started:
            return
        try:
            if picture is not None:
                self.live.update(picture(), refresh=True)
        finally:
            self.live.stop()
