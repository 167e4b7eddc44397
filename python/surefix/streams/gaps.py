"""Where time is missing between two frames."""

import math
from collections.abc import Generator, Iterable
from contextlib import closing
from dataclasses import replace

from surefix.errors import SurefixValueError
from surefix.streams.every import time_of
from surefix.streams.frame import Frame
from surefix.streams.stream import Derived, Shot, shots_of

__all__ = ["Gaps"]


class Gaps(Derived):
    """All frames of a source; those more than so many seconds after the one before, or earlier than
    it, say ``gap``.

    Put it next to the source, under what passes frames over: then the long wait that
    ``EveryMetres`` makes of a standstill is no gap, and a gap among frames that are passed over is
    one before the next that is not.

    Raises
    ------
    SurefixValueError
        For no seconds; and, while it is read, for a frame without a time.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.streams import Frame, Gaps
    >>> frames = [Frame(np.zeros((4, 6), np.uint8), time, str(time)) for time in (0.0, 0.1, 5.0, 5.1, 2.0)]
    >>> [frame.name for frame in Gaps(frames, seconds=1) if frame.gap]
    ['5.0', '2.0']
    """

    def __init__(self, source: Iterable[Frame], seconds: float) -> None:
        if not (math.isfinite(seconds) and seconds > 0):
            raise SurefixValueError(f"gap: expected seconds above 0, got {seconds}")
        super().__init__(source)
        self.seconds = seconds

    @property
    def count(self) -> int | None:
        """As many as the source has."""
        return self.source_count

    @property
    def estimate(self) -> int | None:
        """As the source says."""
        return self.source_estimate

    def shots(self) -> Generator[Shot, None, None]:
        """All, marked."""
        before: float | None = None
        with closing(shots_of(self.source)) as shots:
            for shot in shots:
                time = time_of(shot, "gap")
                broken = before is not None and not 0 <= time - before <= self.seconds
                yield replace(shot, gap=shot.gap or broken)
                before = time
