"""Reading ready distances: the nearest place, the nearest elsewhere; and checks of options."""

from numbers import Real
from operator import index
from typing import SupportsFloat, SupportsIndex, TypeAlias

import numpy as np
import numpy.typing as npt

from surefix._core import match_distances
from surefix.errors import mismatch

__all__ = [
    "Distances",
    "Flags",
    "Floats",
    "Places",
    "checked_window",
    "nearest",
    "nearest_elsewhere",
    "number",
    "whole",
]

Distances: TypeAlias = npt.NDArray[np.float32]
Flags: TypeAlias = npt.NDArray[np.bool_]
Floats: TypeAlias = npt.NDArray[np.float64]
Places: TypeAlias = npt.NDArray[np.int64]


def nearest(D: Distances) -> tuple[Places, Distances]:
    """Each query's nearest place and its distance; errors are those of ``match_distances``."""
    run = match_distances(D, sequence_length=1, weight=0.0, smoothing=1)
    return run.single_place, run.single_distance


def nearest_elsewhere(D: Distances, place: Places, exclude: int) -> Floats:
    """Each query's least distance, (m,), among places more than ``exclude`` from ``place``."""
    elsewhere = np.array(D, np.float32)
    queries = np.arange(D.shape[1])
    for step in range(-exclude, exclude + 1):
        elsewhere[np.clip(place + step, 0, len(D) - 1), queries] = np.inf
    least: Floats = elsewhere.min(axis=0).astype(np.float64)
    return least


def checked_window(exclude: int, places: int) -> int:
    """``exclude``, if a window of it anywhere on the map leaves a place outside."""
    why = f" (less than half of the other {places - 1} places)"
    return whole("exclude", exclude, 0, (places - 2) // 2, why)


def whole(name: str, value: SupportsIndex, low: int, high: int | None = None, why: str = "") -> int:
    """A whole number from ``low`` to ``high``, if given; ``why`` is the reason for ``high``."""
    expected = f"from {low} to {high}{why}" if high is not None else f"of {low} or more"
    got: object = value
    try:
        got = index(value)
        if low <= got and (high is None or got <= high):
            return got
    except TypeError:
        pass
    raise mismatch(f"option `{name}`", f"a whole number {expected}", repr(got))


def number(name: str, value: SupportsFloat, low: float, high: float | None = None) -> float:
    """A finite number from ``low`` to ``high``, if that is given."""
    got = float(value) if isinstance(value, Real) else float("nan")
    if not (low <= got < float("inf")) or (high is not None and got > high):
        expected = f"a finite number of {low:g} or more"
        if high is not None:
            expected = f"a number from {low:g} to {high:g}"
        raise mismatch(f"option `{name}`", expected, repr(value))
    return got
