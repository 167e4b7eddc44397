"""Fewer frames: every n-th, one in a number of seconds or of metres; and gaps between frames."""

import math
from abc import abstractmethod
from collections.abc import Callable, Generator, Iterable
from contextlib import closing
from dataclasses import replace
from itertools import count
from numbers import Integral

from surefix.errors import SurefixValueError, mismatch
from surefix.frames.frame import Frame, Frames, IteratedFrames, Shot
from surefix.frames.odometry import Float64, Odometry


class Derived(Frames):
    """Frames made of others."""

    def __init__(self, source: Iterable[Frame]) -> None:
        self.source = source if isinstance(source, Frames) else IteratedFrames(source)
        self.timed, self.live = self.source.timed, self.source.live
        self.parallel = self.source.parallel

    @property
    def files(self) -> list[str]:
        """Those of the source."""
        return self.source.files

    def close(self) -> None:
        """Ends the source's iteration."""
        self.source.close()


class Selection(Derived):
    """Some of the frames of another source. A gap, or dropped frames, before a frame that is passed
    over count before the next, and so does its advance.
    """

    @abstractmethod
    def chooser(self) -> Callable[[Shot], bool]:
        """Says of each shot, in order, whether to take it; a new one for each iteration."""

    def shots(self) -> Generator[Shot, None, None]:
        """The chosen ones."""
        chooser = self.chooser()
        dropped, gap = 0, False
        moved: float | None = 0.0
        with closing(self.source.shots()) as shots:
            for shot in shots:
                dropped, gap = dropped + shot.dropped, gap or shot.gap
                moved = added(moved, shot.advance)
                if chooser(shot):
                    yield replace(shot, dropped=dropped, gap=gap, advance=moved)
                    dropped, gap, moved = 0, False, 0.0


class Stride(Selection):
    """The first frame, and every n-th after it.

    Raises
    ------
    SurefixValueError
        If the stride is not a whole number of at least 1.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.frames import Frame, Stride
    >>> frames = [Frame(np.zeros((4, 6), np.uint8), None, str(index)) for index in range(5)]
    >>> [frame.name for frame in Stride(frames, 2)]
    ['0', '2', '4']
    """

    def __init__(self, source: Iterable[Frame], stride: int) -> None:
        super().__init__(source)
        self.stride = check_stride(stride)
        self._count, self._estimate = (
            None if known is None else math.ceil(known / self.stride)
            for known in (self.source.count, self.source.estimate)
        )

    def chooser(self) -> Callable[[Shot], bool]:
        """Counts the shots."""
        numbers = count()
        return lambda _: next(numbers) % self.stride == 0


class Every(Selection):
    """The first frame, and then the first frame of each period of a number of seconds.

    A frame that is late does not delay those after it. If the time goes back, it begins anew.

    Raises
    ------
    SurefixValueError
        If the seconds are not above 0; while it is read, for a frame without a time.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.frames import Every, Frame
    >>> frames = [Frame(np.zeros((4, 6), np.uint8), 0.4 * index, str(index)) for index in range(7)]
    >>> [frame.name for frame in Every(frames, 1.0)]
    ['0', '3', '5']
    """

    def __init__(self, source: Iterable[Frame], seconds: float) -> None:
        super().__init__(source)
        self.seconds = above_0("every", "seconds", seconds)

    def chooser(self) -> Callable[[Shot], bool]:
        """Looks at the clock."""
        start, period, last = 0.0, -1, 0.0

        def choose(shot: Shot) -> bool:
            nonlocal start, period, last
            time = time_of(shot, "every")
            if period < 0 or time < last:
                start, period = time, -1
            last = time
            now = math.floor((time - start) / self.seconds)
            if now <= period:
                return False
            period = now
            return True

        return choose


class Placed:
    """The times of an iteration's frames by an odometry's clock."""

    def __init__(self, odometry: Odometry) -> None:
        self.odometry = odometry
        self.inside = self.outside = 0
        self._low, self._high = math.inf, -math.inf

    def time_of(self, shot: Shot, option: str) -> float:
        """The time of the next frame."""
        time = time_of(shot, option) if shot.clock is None else shot.clock
        covered = self.odometry.times[0] <= time <= self.odometry.times[-1]
        self.inside, self.outside = self.inside + covered, self.outside + (not covered)
        self._low, self._high = min(self._low, time), max(self._high, time)
        return time

    def check(self) -> None:
        """Refuses an odometry that knows the position of no frame."""
        if self.outside and not self.inside:
            times = self.odometry.times
            expected = f"positions at the times of the frames, {self._low} s to {self._high} s"
            got = f"those of {times[0]} s to {times[-1]} s: are the clocks the same?"
            raise mismatch(self.odometry.source, expected, got)


class EveryMetres(Selection):
    """A frame every few metres, as the method wants: a query's neighbours are then as far apart as
    the map's.

    The first frame with a known position is taken; then each whose straight distance from the one
    taken before, with the overshoot of that one, reaches ``metres``. So frames are ``metres`` apart
    on average at any speed; a standstill yields none; and the noise of a receiver does not add up
    to a path. Frames before the first position and after the last are passed over.

    Parameters
    ----------
    source : iterable of Frame
        With times, of the odometry's clock.
    odometry : Odometry
    metres : float
        Above 0.

    Raises
    ------
    SurefixValueError
        For another distance; while it is read, for a frame without a time, and if no frame lies
        within the odometry's times: the two clocks differ.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.frames import EveryMetres, Frame, Odometry
    >>> frames = [Frame(np.zeros((4, 6), np.uint8), float(time), str(time)) for time in range(6)]
    >>> halts = Odometry([0, 2, 3, 5], [[0.0, 0.0], [2.0, 0.0], [2.0, 0.0], [4.0, 0.0]])
    >>> [frame.name for frame in EveryMetres(frames, halts, metres=1)]
    ['0', '1', '2', '4', '5']
    """

    def __init__(self, source: Iterable[Frame], odometry: Odometry, metres: float) -> None:
        super().__init__(source)
        self.odometry = odometry
        self.metres = above_0("metres", "a distance", metres)
        self._placed = Placed(odometry)

    def chooser(self) -> Callable[[Shot], bool]:
        """Looks at the odometry."""
        last: Float64 | None = None
        over = 0.0
        placed = self._placed = Placed(self.odometry)

        def choose(shot: Shot) -> bool:
            nonlocal last, over
            time = placed.time_of(shot, "metres")
            here = self.odometry.at(time)
            if here is None:
                return False
            driven = over if last is None else math.dist(here, last) + over
            # Short of it by a rounding error counts as there.
            nearly = 1e-9 * self.metres
            if last is not None and driven < self.metres - nearly:
                return False
            over = math.fmod(driven, self.metres)
            last, over = here, 0.0 if self.metres - over < nearly else over
            return True

        return choose

    def shots(self) -> Generator[Shot, None, None]:
        """The chosen ones."""
        yield from super().shots()
        self._placed.check()


class Gaps(Derived):
    """All frames of a source. One more than some seconds after the one before, or earlier, has
    ``gap`` set.

    Put it next to the source, under the selections: then the long wait that ``EveryMetres`` makes
    of a standstill is no gap, and a gap among frames that are passed over counts before the next.

    Raises
    ------
    SurefixValueError
        If the seconds are not above 0; while it is read, for a frame without a time.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.frames import Frame, Gaps
    >>> times = (0.0, 0.1, 5.0, 5.1, 2.0)
    >>> frames = [Frame(np.zeros((4, 6), np.uint8), time, str(time)) for time in times]
    >>> [frame.name for frame in Gaps(frames, seconds=1) if frame.gap]
    ['5.0', '2.0']
    """

    def __init__(self, source: Iterable[Frame], seconds: float) -> None:
        super().__init__(source)
        self.seconds = above_0("gap", "seconds", seconds)
        self._count, self._estimate = self.source.count, self.source.estimate

    def shots(self) -> Generator[Shot, None, None]:
        """All, marked."""
        before: float | None = None
        with closing(self.source.shots()) as shots:
            for shot in shots:
                time = time_of(shot, "gap")
                broken = before is not None and not 0 <= time - before <= self.seconds
                yield replace(shot, gap=shot.gap or broken)
                before = time


def added(moved: float | None, more: float | None) -> float | None:
    """The sum of two advances; None if one is unknown."""
    return None if moved is None or more is None else moved + more


def check_stride(stride: object) -> int:
    """The stride, an integer of Python's or of NumPy's, at least 1."""
    if isinstance(stride, bool) or not isinstance(stride, Integral) or stride < 1:
        raise mismatch("stride", "a whole number of at least 1", repr(stride))
    return int(stride)


def above_0(option: str, what: str, value: float) -> float:
    if not (math.isfinite(value) and value > 0):
        raise mismatch(option, f"{what} above 0", value)
    return value


def time_of(shot: Shot, option: str) -> float:
    if shot.time is None:
        expected = "expected frames with times, as those of a video or a bag"
        raise SurefixValueError(f"{option}: {expected}; {shot.name} has none")
    return shot.time
