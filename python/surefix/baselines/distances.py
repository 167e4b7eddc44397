"""What the methods read from ready distances: the nearest place, and the nearest elsewhere."""

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from surefix._core import Run, match_distances
from surefix.baselines.options import whole

__all__ = [
    "Distances",
    "Flags",
    "Floats",
    "Places",
    "checked_window",
    "nearest",
    "nearest_elsewhere",
]

Distances: TypeAlias = npt.NDArray[np.float32]
Flags: TypeAlias = npt.NDArray[np.bool_]
Floats: TypeAlias = npt.NDArray[np.float64]
Places: TypeAlias = npt.NDArray[np.int64]


def nearest(D: Distances) -> tuple[Places, Distances]:
    """Each query's place of least distance and that distance; the errors are those of
    ``surefix.match_distances``.
    """
    run: Run = match_distances(D, sequence_length=1, weight=0.0, smoothing=1)
    return run.single_place, run.single_distance


def checked_window(exclude: int, places: int) -> int:
    """``exclude``, if its window leaves a place elsewhere wherever on the map it lies."""
    return whole(
        "exclude",
        exclude,
        0,
        (places - 2) // 2,
        f" (less than half of the other {places - 1} places)",
    )


def nearest_elsewhere(D: Distances, place: Places, exclude: int) -> Floats:
    """Each query's least distance, shape (m,), among the places more than ``exclude`` from
    ``place``.
    """
    elsewhere = np.array(D, np.float32)
    queries = np.arange(D.shape[1])
    for step in range(-exclude, exclude + 1):
        elsewhere[np.clip(place + step, 0, len(D) - 1), queries] = np.inf
    least: Floats = elsewhere.min(axis=0).astype(np.float64)
    return least
