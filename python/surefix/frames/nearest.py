"""Fewer frames, evenly apart: one in a number of seconds or of metres."""

import math
from abc import ABC, abstractmethod
from collections.abc import Generator, Iterable
from contextlib import closing
from typing import Any

from surefix.frames.clock import Placed
from surefix.frames.frame import Frame, Shot
from surefix.frames.odometry import Float64, Odometry
from surefix.frames.sampling import Derived, above_0, follow, time_of

# In steps: a frame this little before a mark is at it.
ROUNDING = 1e-6


class Ruler(ABC):
    """Marks at equal steps, of time or of way; ``at`` is where a frame is along it."""

    @abstractmethod
    def at(self, shot: Shot) -> Any:
        """Where the next frame of the source is; None if that is not known."""

    @abstractmethod
    def begins(self, shot: Shot, at: Any) -> bool:
        """Whether the marks begin, or begin anew, at this frame."""

    @abstractmethod
    def begin(self, at: Any) -> None:
        """The first mark is here."""

    @abstractmethod
    def off(self, at: Any) -> float:
        """How far it is past the next mark, in steps; below 0 before it."""

    @abstractmethod
    def take(self, at: Any) -> None:
        """A frame is taken for the next mark."""


class Nearest(Derived):
    """Of the frames around each mark of a ruler, the nearest; of two as near, the one after it.
    None is taken twice.

    A frame shortly before a mark waits for the one after it, to see which is nearer. So a stream is
    at most one frame of its source behind.
    """

    @abstractmethod
    def ruler(self) -> Ruler:
        """A new one for each iteration."""

    @property
    def total(self) -> int | None:
        """None: of the frames that are chosen, all come."""
        return None

    def shots(self) -> Generator[Shot, None, None]:
        """The chosen ones."""
        ruler = self.ruler()
        # The nearest before the next mark, and those passed over since.
        held: Shot | None = None
        held_at: Any = None
        passed: Shot | None = None
        # Where the last two frames are.
        two: tuple[Any, Any] = (None, None)
        with closing(self.source.shots()) as shots:
            for shot in shots:
                at = ruler.at(shot)
                if at is None:
                    passed = follow(passed, shot)
                    continue
                begins = ruler.begins(shot, at)
                off = math.inf if begins else ruler.off(at)
                if held is not None and off >= -ROUNDING:
                    before = -ruler.off(held_at)
                    nearer = before < off - ROUNDING
                    if _is_last(ruler, held_at, two) if off > 1 else nearer:
                        yield held
                        ruler.take(held_at)
                        off = math.inf if begins else ruler.off(at)
                    else:
                        passed = follow(held, passed)
                    held = None
                two = two[1], at
                if off >= -ROUNDING:
                    yield follow(passed, shot)
                    (ruler.begin if begins or off > 1 else ruler.take)(at)
                    passed = None
                elif held is None or off >= ruler.off(held_at):
                    held, held_at, passed = follow(held, passed, shot), at, None
                else:
                    passed = follow(passed, shot)
        if held is not None and _is_last(ruler, held_at, two):
            yield held


def _is_last(ruler: Ruler, held: Any, two: tuple[Any, Any]) -> bool:
    """Whether a frame is that of the next mark if no frame follows the last two: one more, as far
    on, would not be nearer.
    """
    return ruler.off(held) > (ruler.off(two[0]) - ruler.off(two[1])) / 2


class Every(Nearest):
    """The first frame, and then the frame nearest to each tick of a number of seconds.

    So a clock that jitters, or a camera a little slower or faster than the ticks, gives frames that
    are evenly apart. The ticks begin anew at a gap, at a frame later than a tick by more than a
    period, and if the time goes back.

    Raises
    ------
    SurefixValueError
        If the seconds are not above 0; while it is read, for a frame without a time.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.frames import Every, Frame
    >>> frames = [Frame(np.zeros((4, 6), np.uint8), 0.3 * index, str(index)) for index in range(9)]
    >>> [frame.name for frame in Every(frames, 1.0)]
    ['0', '3', '7']
    """

    def __init__(self, source: Iterable[Frame], seconds: float) -> None:
        super().__init__(source)
        self.seconds = above_0("every", "seconds", seconds)

    def ruler(self) -> Ruler:
        """Ticks of a clock."""
        return _Clock(self.seconds)


class _Clock(Ruler):
    """Ticks; ``at`` is a time."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self.start, self.tick, self.last = 0.0, 0, math.inf

    def at(self, shot: Shot) -> float:
        return time_of(shot, "every")

    def begins(self, shot: Shot, at: float) -> bool:
        before, self.last = self.last, at
        return at < before or shot.gap

    def begin(self, at: float) -> None:
        self.start, self.tick = at, 1

    def off(self, at: float) -> float:
        return (at - self.start) / self.seconds - self.tick

    def take(self, at: float) -> None:
        self.tick += 1


class EveryMetres(Nearest):
    """A frame every few metres, as the method wants: a query's neighbours are then as far apart as
    the map's.

    The first frame with a known position is taken; then each that is nearest to ``metres`` from the
    one taken before, in a straight line, with what that one was too far or too short. So frames are
    ``metres`` apart on average at any speed; a standstill yields none; and the noise of a receiver
    does not add up to a path. Frames before the first position and after the last are passed over;
    ``remarks`` counts them.

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
        For another distance; while it is read, for a frame without a time, and if the odometry's
        times are those of another clock or unit: hardly a frame lies within them.

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

    @property
    def remarks(self) -> list[str]:
        """The frames whose position is not known, and what was assumed of the odometry."""
        return self._placed.remarks("passed over")

    def ruler(self) -> Ruler:
        """Marks along the odometry's way."""
        self._placed = Placed(self.odometry)
        return _Way(self.metres, self._placed)

    def shots(self) -> Generator[Shot, None, None]:
        """The chosen ones."""
        yield from super().shots()
        self._placed.check()


class _Way(Ruler):
    """Marks along the way; ``at`` is a position."""

    def __init__(self, metres: float, placed: Placed) -> None:
        self.metres, self.placed = metres, placed
        self.last: Float64 | None = None
        self.over = 0.0

    def at(self, shot: Shot) -> Float64 | None:
        return self.placed.odometry.at(self.placed.time_of(shot, "metres"))

    def begins(self, shot: Shot, at: Float64) -> bool:
        return self.last is None

    def begin(self, at: Float64) -> None:
        self.last, self.over = at, 0.0

    def off(self, at: Float64) -> float:
        assert self.last is not None
        return (math.dist(at, self.last) + self.over) / self.metres - 1

    def take(self, at: Float64) -> None:
        self.last, self.over = at, self.metres * self.off(at)
