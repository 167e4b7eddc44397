"""Fewer frames: one every so many metres."""

import math
from collections.abc import Callable, Generator, Iterable

from surefix.errors import SurefixValueError
from surefix.streams.every import time_of
from surefix.streams.frame import Frame
from surefix.streams.odometry import Float64, Odometry
from surefix.streams.stream import Selection, Shot

__all__ = ["EveryMetres"]


class EveryMetres(Selection):
    """A frame every so many metres, as the method wants: then a query's neighbours are as far apart
    as the map's.

    The first frame whose position is known is taken; then each whose straight distance from the one
    taken before, with what that one overshot, comes to ``metres``. So frames are ``metres`` apart
    on average, however far apart the camera takes them; standing still yields none; and the noise
    of a receiver does not add up to a path. Frames before the first position and after the last are
    passed over.

    Parameters
    ----------
    source : iterable of Frame
        With times, of the odometry's clock.
    odometry : Odometry
    metres : float
        Above 0.

    Raises ------ SurefixValueError For another distance; while it is read, for a frame without a
    time, and where no frame lies within the odometry's times: the two clocks differ.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.streams import EveryMetres, Frame, Odometry
    >>> frames = [Frame(np.zeros((4, 6), np.uint8), float(time), str(time)) for time in range(6)]
    >>> halts = Odometry([0, 2, 3, 5], [[0.0, 0.0], [2.0, 0.0], [2.0, 0.0], [4.0, 0.0]])
    >>> [frame.name for frame in EveryMetres(frames, halts, metres=1)]
    ['0', '1', '2', '4', '5']
    """

    def __init__(self, source: Iterable[Frame], odometry: Odometry, metres: float) -> None:
        super().__init__(source)
        if not (math.isfinite(metres) and metres > 0):
            raise SurefixValueError(f"metres: expected a distance above 0, got {metres}")
        self.odometry = odometry
        self.metres = metres

    def chooser(self) -> Callable[[Shot], bool]:
        """Looks at the odometry."""
        return _Walk(self.odometry, self.metres).takes

    def shots(self) -> Generator[Shot, None, None]:
        """Those that are chosen."""
        walk = _Walk(self.odometry, self.metres)
        yield from self.chosen(walk.takes)
        walk.check()


class _Walk:
    """How far it is from the frame that was taken last."""

    def __init__(self, odometry: Odometry, metres: float) -> None:
        self.odometry = odometry
        self.metres = metres
        self.last: Float64 | None = None
        self.over = 0.0
        self.seen: tuple[float, float] | None = None

    def takes(self, shot: Shot) -> bool:
        time = time_of(shot, "metres")
        self.seen = (
            (time, time)
            if self.seen is None
            else (min(self.seen[0], time), max(self.seen[1], time))
        )
        here = self.odometry.at(time)
        if here is None:
            return False
        driven = self.over if self.last is None else math.dist(here, self.last) + self.over
        # A rounding error short of it is there.
        nearly = 1e-9 * self.metres
        if self.last is not None and driven < self.metres - nearly:
            return False
        over = math.fmod(driven, self.metres)
        self.last, self.over = here, 0.0 if self.metres - over < nearly else over
        return True

    def check(self) -> None:
        """That there was a position for one frame at least."""
        if self.last is None and self.seen is not None:
            times = self.odometry.times
            raise SurefixValueError(
                f"{self.odometry.source}: expected positions at the times of the frames, {self.seen[0]} s to "
                f"{self.seen[1]} s, got those of {times[0]} s to {times[-1]} s: are the clocks the same?"
            )
