"""Whether two answers are the same: a benchmark of wrong answers says nothing."""

from typing import Any

import numpy as np

__all__ = ["same_best", "same_distances", "same_numbers"]


def same_distances(ours: Any, theirs: Any, tolerance: float) -> str:
    """What is wrong with distances to all places, within a share of the larger ones."""
    ours, theirs = np.asarray(ours, np.float64).ravel(), np.asarray(theirs, np.float64).ravel()
    if ours.shape != theirs.shape:
        return f"surefix gives {ours.size} distances, the rival {theirs.size}"
    off = np.abs(ours - theirs) - tolerance * np.abs(theirs).max(initial=0.0)
    worst = int(off.argmax())
    if not off[worst] <= 0:
        return f"place {worst}: surefix says {ours[worst]:.9g}, the rival {theirs[worst]:.9g}"
    return ""


def same_best(ours: Any, theirs: tuple[int, float], tolerance: float) -> str:
    """What is wrong with a rival's nearest place and its distance, given surefix's distances to
    all.
    """
    place, distance = int(np.argmin(ours)), float(np.min(ours))
    if place != theirs[0] or not abs(distance - theirs[1]) <= tolerance * max(abs(distance), 1e-3):
        return f"surefix finds place {place} at {distance:.9g}, the rival place {theirs[0]} at {theirs[1]:.9g}"
    return ""


def same_numbers(ours: Any, theirs: Any) -> str:
    """What is wrong where answers must be equal to the last bit."""
    return "" if ours == theirs else f"surefix says {ours}, the other {theirs}"
