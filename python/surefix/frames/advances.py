"""The places that a robot has moved between two frames, by its odometry."""

import math
import re
from collections.abc import Generator, Iterable
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from surefix.errors import mismatch
from surefix.frames.clock import Placed, check_ranges
from surefix.frames.frame import Frame, Frames, Shot
from surefix.frames.odometry import Odometry
from surefix.frames.sampling import Derived


class Advances(Derived):
    """All frames of a source, each with its ``advance``: the places that the robot has moved since
    the frame before, by its odometry.

    It is the last step, over the selections. The first frame has no advance. Nor has a frame before
    the odometry's first time or after its last, or the one that follows such a frame; ``outside``
    counts those frames.

    Parameters
    ----------
    source : iterable of Frame
        With times, of the odometry's clock.
    odometry : Odometry
    places_per_metre : float
        Not 0; below 0 if the robot drives the route from its end to its start, or its forward axis
        points backwards. ``surefix.datasets.places_per_metre`` has that of a map's positions.

    Attributes
    ----------
    outside : int
        The number of frames outside the odometry's times in the newest iteration so far.

    Raises
    ------
    SurefixValueError
        For another number; while it is read, for a frame without a time, and if the odometry's
        times are those of another clock or unit: hardly a frame lies within them.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.frames import Advances, Frame, Odometry
    >>> frames = [Frame(np.zeros((4, 6), np.uint8), float(time), str(time)) for time in range(5)]
    >>> wheels = Odometry([0, 1, 2, 3], [[0.0], [3.0], [3.0], [2.0]])
    >>> [frame.advance for frame in Advances(frames, wheels, places_per_metre=0.5)]
    [None, 1.5, 0.0, -0.5, None]
    """

    def __init__(
        self, source: Iterable[Frame], odometry: Odometry, places_per_metre: float
    ) -> None:
        super().__init__(source)
        if not (math.isfinite(places_per_metre) and places_per_metre):
            raise mismatch("places_per_metre", "a number other than 0", places_per_metre)
        self.odometry, self.places_per_metre = odometry, places_per_metre
        self._count, self._estimate = self.source.count, self.source.estimate
        self._placed = Placed(odometry)

    @property
    def outside(self) -> int:
        """The number of frames outside the odometry's times."""
        return self._placed.outside

    @property
    def remarks(self) -> list[str]:
        """The frames whose advance is not known, and what was assumed of the odometry."""
        return self._placed.remarks("without an advance")

    def shots(self) -> Generator[Shot, None, None]:
        """All, with their advances."""
        placed = self._placed = Placed(self.odometry)
        before: float | None = None
        with closing(self.source.shots()) as shots:
            for shot in shots:
                time = placed.time_of(shot, "odometry")
                metres = None if before is None else self.odometry.moved(before, time)
                advance = None if metres is None else self.places_per_metre * metres
                yield replace(shot, advance=advance)
                before = time
        placed.check()


class Clocked(Derived):
    """All frames of a source, each with its time by the odometry's clock in ``clock``: its number
    with ``by_number``, else the time in its name.
    """

    def __init__(self, source: Frames, by_number: bool) -> None:
        super().__init__(source)
        self.by_number = by_number
        self._count, self._estimate = source.count, source.estimate

    def shots(self) -> Generator[Shot, None, None]:
        """All, with their times."""
        number = 0
        with closing(self.source.shots()) as shots:
            for shot in shots:
                number += shot.dropped
                clock = float(number) if self.by_number else time_in(shot.name)
                yield replace(shot, clock=clock)
                number += 1


def on_clock(source: Frames, odometry: Odometry) -> tuple[Frames, Odometry]:
    """Frames and an odometry with one clock: the frames' own times, the times in their files' names
    if they have none, or the numbers of frames and rows, if the rows are one a frame.

    Raises
    ------
    SurefixValueError
        If the frames have no times; or times of another clock or unit, if their range is known.
    """
    if odometry.by_frame and not (odometry.timed and source.timed):
        return Clocked(source, by_number=True), odometry.numbered()
    if source.timed:
        if source.span is not None:
            check_ranges(odometry, source.span)
        return source, odometry
    times = [time_in(Path(file).name) for file in source.files]
    named = [time for time in times if time is not None]
    nameless = [file for file, time in zip(source.files, times, strict=True) if time is None]
    if nameless or not source.files:
        expected = "frames with times, as of a video or a bag, or files named by their times"
        raise mismatch(odometry.source, expected, nameless[0] if nameless else "neither")
    check_ranges(odometry, (min(named), max(named)))
    return Clocked(source, by_number=False), odometry


def time_in(name: str) -> float | None:
    """The time in seconds that a file is named by: a whole number of milli-, micro- or nanoseconds
    since 1970, such as EuRoC's, or seconds with a decimal point, such as TUM's. Else None.
    """
    stem = Path(name).stem
    if re.fullmatch(r"\d{13}|\d{16}|\d{19}", stem):
        return int(stem) / 10.0 ** (len(stem) - 10)
    return float(stem) if re.fullmatch(r"\d+\.\d+", stem) else None
