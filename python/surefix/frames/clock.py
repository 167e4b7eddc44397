"""Whether frames and an odometry have one clock."""

import math

import numpy as np

from surefix._words import plural, verb
from surefix.errors import mismatch
from surefix.frames.frame import Shot
from surefix.frames.odometry import Odometry
from surefix.frames.sampling import time_of

# Of a second, as recorders write them.
UNITS = {1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds"}
# Of so many frames, so small a share by chance within the odometry's times is a wrong clock.
MANY, FEW = 20, 0.05
# Of the frames outside, those that are named.
NAMED = 3
Range = tuple[float, float]


class Placed:
    """The times of an iteration's frames by an odometry's clock."""

    def __init__(self, odometry: Odometry) -> None:
        self.odometry = odometry
        self.inside = self.outside = self.between = 0
        self._names: list[str] = []
        self._low, self._high = math.inf, -math.inf
        self._holes = _holes(odometry)

    def time_of(self, shot: Shot, option: str) -> float:
        """The time of the next frame."""
        time = time_of(shot, option) if shot.clock is None else shot.clock
        covered = self.odometry.times[0] <= time <= self.odometry.times[-1]
        self.inside, self.outside = self.inside + covered, self.outside + (not covered)
        self._low, self._high = min(self._low, time), max(self._high, time)
        self.between += any(start < time < end for start, end in self._holes)
        if not covered and len(self._names) < NAMED:
            self._names.append(shot.name)
        return time

    def check(self) -> None:
        """Refuses an odometry of another clock, or of another unit of time."""
        count = self.inside + self.outside
        if not count:
            return
        few = not self.inside or (count >= MANY and self.inside < FEW * count)
        check_ranges(self.odometry, (self._low, self._high), few)

    def remarks(self, fate: str) -> list[str]:
        """The frames whose position is unknown, and what became of them; or made up."""
        said: list[str] = []
        times = self.odometry.times
        if self.outside:
            names = ", ".join(self._names) + (", ..." if self.outside > NAMED else "")
            count = plural(self.inside + self.outside, "frame")
            covers = f"the odometry covers {_range((times[0], times[-1]))}"
            frames = f"the frames {_range((self._low, self._high))}"
            part = "warning: " if self.outside > self.inside else ""
            where = "before its first or after its last time"
            said.append(
                f"{part}{self.outside} of {count} {where} {verb(self.outside)} {fate} ({names}); "
                f"{covers}, {frames}"
            )
        if self.between:
            longest = max(self._holes, key=lambda hole: hole[1] - hole[0])
            said.append(
                f"{plural(self.between, 'frame')} in a pause of the odometry, such as "
                f"{_range(longest)}: positions there are on a straight line"
            )
        return [f"{self.odometry.source}: {text}" for text in said] + self.odometry.remarks


def check_ranges(odometry: Odometry, frames: Range, few: bool | None = None) -> None:
    """Refuses an odometry whose times are of another clock or unit than those of the frames, by
    the range of both; ``few`` says whether hardly a frame lies within, by default if none can.
    """
    times = odometry.times
    has = float(times[0]), float(times[-1])
    unit = _unit(odometry, frames)
    if few is None:
        few = frames[1] < has[0] or has[1] < frames[0]
    if not few and unit is None:
        return
    expected = f"positions at the times of the frames, {_range(frames)}"
    guess = f"are the clocks the same? The first times differ by {has[0] - frames[0]:.3f} s"
    if unit is not None:
        guess = f"are these {unit}? Seconds are expected"
    raise mismatch(odometry.source, expected, f"those of {_range(has)}: {guess}")


def _unit(odometry: Odometry, frames: Range) -> str | None:
    """The unit in which the odometry's times fit those of the frames, if it is no second."""
    times = odometry.times
    if len(times) < 2:
        return None
    # A hundred rows a second are ten milliseconds apart: seldom is a row in seconds that rare.
    sparse = float(np.median(np.diff(times))) > 0.99
    found = (
        name
        for factor, name in UNITS.items()
        if _common((times[0] / factor, times[-1] / factor), frames) > 0.5
    )
    own = _common((times[0], times[-1]), frames)
    return next(found, None) if sparse and own < 0.02 else None


def _common(one: Range, other: Range) -> float:
    """The length that two ranges have in common, as a share of that of both."""
    both = min(one[1], other[1]) - max(one[0], other[0])
    either = max(one[1], other[1]) - min(one[0], other[0])
    return max(0.0, float(both)) / float(either) if either > 0 else 0.0


def _holes(odometry: Odometry) -> list[Range]:
    """Pauses of the odometry over which the robot moved."""
    times, at = odometry.times, odometry.positions
    if len(times) < 3:
        return []
    steps = np.diff(times)
    long = steps > max(1.0, 20 * float(np.median(steps)))
    moved = (at[1:] != at[:-1]).any(axis=1)
    return [(float(times[row]), float(times[row + 1])) for row in np.flatnonzero(long & moved)]


def _range(times: Range) -> str:
    return f"{float(times[0])} s to {float(times[1])} s"
