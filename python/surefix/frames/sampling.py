"""Fewer frames: every n-th; and gaps between frames."""

import math
from abc import abstractmethod
from collections.abc import Callable, Generator, Iterable
from contextlib import closing
from dataclasses import replace
from itertools import count
from numbers import Integral

from surefix.errors import SurefixValueError, mismatch
from surefix.frames.frame import Frame, Frames, IteratedFrames, Shot, added


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

    @property
    def total(self) -> int | None:
        """That of the source."""
        return self.source.total

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

    @property
    def total(self) -> int | None:
        """None: of the frames that are chosen, all come."""
        return None

    def shots(self) -> Generator[Shot, None, None]:
        """The chosen ones."""
        chooser = self.chooser()
        passed: Shot | None = None
        with closing(self.source.shots()) as shots:
            for shot in shots:
                now = follow(passed, shot)
                chosen = chooser(shot)
                if chosen:
                    yield now
                passed = None if chosen else now


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


def follow(*shots: Shot | None) -> Shot:
    """The last one, with the gaps, dropped frames and advances of those before it. Frames that are
    chosen are counted anew.
    """
    known = [shot for shot in shots if shot is not None]
    moved: float | None = 0.0
    for shot in known:
        moved = added(moved, shot.advance)
    dropped, gap = sum(shot.dropped for shot in known), any(shot.gap for shot in known)
    return replace(known[-1], dropped=dropped, gap=gap, advance=moved, number=None)


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
