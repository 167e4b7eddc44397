"""Where a recorded road breaks: jumps of its positions, and gaps in its time."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from surefix._words import plural

Float64 = npt.NDArray[np.float64]

# A break is this many times the usual step or interval, and the steps around it.
TIMES = 10
# In metres and in seconds: nothing shorter is a break.
LEAST_JUMP, LEAST_GAP = 20.0, 2.0
# The steps on each side that a jump is compared with.
AROUND = 5
# Over a gap in time the robot has stood still if it moved less than this many usual steps.
STOOD = 3
# Breaks that are named.
NAMED = 5


@dataclass(frozen=True)
class Break:
    """The place at which a new segment begins, and why."""

    place: int
    why: str = ""


def usual_step(positions: Float64) -> float:
    """The median distance between two places in a row, without standstills; 0 if all stand."""
    steps = steps_of(positions)
    moving = steps[steps > 0]
    return float(np.median(moving)) if len(moving) else 0.0


def steps_of(positions: Float64) -> Float64:
    """The distance from each place to the next, (n - 1,), in metres."""
    return np.asarray(np.linalg.norm(np.diff(positions, axis=0), axis=1), np.float64)


def jumps(positions: Float64) -> list[tuple[int, float]]:
    """The places before which the positions jump, and by how many metres.

    A jump is more than 20 m and 10 times the usual step, and 10 times the steps around it: the
    longer of the medians of the five before and the five after, and of the next ones. So a fast
    stretch is none. Nor is it one if the positions come back within five places: that is a
    receiver's error.
    """
    steps, usual = steps_of(positions), usual_step(positions)
    long = np.flatnonzero(steps > max(LEAST_JUMP, TIMES * usual))
    found: list[int] = []
    for at in long.tolist():
        before, after = steps[max(at - AROUND, 0) : at], steps[at + 1 : at + 1 + AROUND]
        sides = [side for side in (before, after) if len(side)]
        medians = [float(np.median(side)) for side in sides]
        nearest = [float(before[-1])] if len(before) else []
        nearest += [float(after[0])] if len(after) else []
        if steps[at] > TIMES * max(*medians, *nearest, usual):
            found.append(at)
    back: set[int] = set()
    for first, second in pairwise(found):
        apart = float(np.linalg.norm(positions[second + 1] - positions[first]))
        if second - first <= AROUND and apart <= STOOD * usual * (second - first + 1):
            back |= {first, second}
    return [(at + 1, float(steps[at])) for at in found if at not in back]


def gaps(times: Sequence[float | None], positions: Float64 | None) -> list[tuple[int, float]]:
    """The places before which time is missing, and the seconds; below 0 if the clock goes back.

    A gap is more than 2 s and 10 times the usual interval. With positions it is none if the robot
    moved less than 3 usual steps over it: it stood still.
    """
    clock = np.array([np.nan if time is None else time for time in times], np.float64)
    if len(clock) < 2 or np.isnan(clock).any():
        return []
    waits = np.diff(clock)
    on = waits[waits > 0]
    usual = float(np.median(on)) if len(on) else 0.0
    missing = waits > max(LEAST_GAP, TIMES * usual)
    if positions is not None:
        missing &= steps_of(positions) > STOOD * usual_step(positions)
    return [(int(at) + 1, float(waits[at])) for at in np.flatnonzero(missing | (waits < 0))]


def found_breaks(positions: Float64 | None, times: Sequence[float | None] = ()) -> list[Break]:
    """The breaks by positions and times, each with why."""
    why: dict[int, list[str]] = {}
    if positions is not None:
        for place, metres in jumps(positions):
            why.setdefault(place, []).append(said_jump(metres))
    for place, seconds in gaps(times, positions):
        said = f"a gap of {seconds:.0f} s" if seconds > 0 else "the clock goes back"
        why.setdefault(place, []).append(said)
    return [Break(place, ", ".join(why[place])) for place in sorted(why)]


def said_jump(metres: float) -> str:
    """A jump in words."""
    return f"a jump of {metres:.0f} m"


def said_breaks(breaks: Sequence[Break]) -> list[str]:
    """The breaks in words; none if there are none."""
    if not breaks:
        return []
    named = [
        f"before {'place ' if index == 0 else ''}{each.place}" + (each.why and f" ({each.why})")
        for index, each in enumerate(breaks[:NAMED])
    ]
    more = [f"{len(breaks) - NAMED} more"] if len(breaks) > NAMED else []
    return [f"{plural(len(breaks), 'break')}: {', '.join([*named, *more])}"]
