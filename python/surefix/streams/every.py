"""Fewer frames: every n-th, or one every so many seconds."""

import math
from collections.abc import Callable, Iterable
from numbers import Integral

from surefix.errors import SurefixValueError
from surefix.streams.frame import Frame
from surefix.streams.stream import Selection, Shot

__all__ = ["Every", "Stride", "check_stride", "time_of"]


class Stride(Selection):
    """The first frame, and every n-th after it.

    Raises
    ------
    SurefixValueError
        For a stride that is no whole number of at least 1.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.streams import Frame, Stride
    >>> frames = [Frame(np.zeros((4, 6), np.uint8), None, str(index)) for index in range(5)]
    >>> [frame.name for frame in Stride(frames, 2)]
    ['0', '2', '4']
    """

    def __init__(self, source: Iterable[Frame], stride: int) -> None:
        super().__init__(source)
        self.stride = check_stride(stride)

    @property
    def count(self) -> int | None:
        """How many are left, where that is known."""
        return None if self.source_count is None else math.ceil(self.source_count / self.stride)

    @property
    def estimate(self) -> int | None:
        """About how many are left."""
        return (
            None if self.source_estimate is None else math.ceil(self.source_estimate / self.stride)
        )

    def chooser(self) -> Callable[[Shot], bool]:
        """Counts the shots."""
        taken = -1

        def choose(_: Shot) -> bool:
            nonlocal taken
            taken = (taken + 1) % self.stride
            return taken == 0

        return choose


class Every(Selection):
    """The first frame, and then the first of every so many seconds from it.

    A frame that is late does not make the ones after it late. Where the time goes back, it begins
    anew.

    Raises
    ------
    SurefixValueError
        For no seconds; and, while it is read, for a frame without a time.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.streams import Every, Frame
    >>> frames = [Frame(np.zeros((4, 6), np.uint8), 0.4 * index, str(index)) for index in range(7)]
    >>> [frame.name for frame in Every(frames, 1.0)]
    ['0', '3', '5']
    """

    def __init__(self, source: Iterable[Frame], seconds: float) -> None:
        super().__init__(source)
        if not (math.isfinite(seconds) and seconds > 0):
            raise SurefixValueError(f"every: expected seconds above 0, got {seconds}")
        self.seconds = seconds

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


def check_stride(stride: object) -> int:
    """The stride, an integer of Python's or of numpy's.

    Raises
    ------
    SurefixValueError
        For anything but a whole number of at least 1.
    """
    if isinstance(stride, bool) or not isinstance(stride, Integral) or stride < 1:
        raise SurefixValueError(f"stride: expected a whole number of at least 1, got {stride!r}")
    return int(stride)


def time_of(shot: Shot, option: str) -> float:
    """When it was taken, in seconds.

    Raises
    ------
    SurefixValueError
        Where nobody says.
    """
    if shot.time is None:
        raise SurefixValueError(
            f"{option}: expected frames that say when they were taken, as those of a video or a bag do; "
            f"{shot.name} does not"
        )
    return shot.time
