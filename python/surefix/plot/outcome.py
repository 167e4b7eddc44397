"""The outcome of a fix: right or wrong, trusted or not."""

from enum import Enum

import numpy as np
from numpy.typing import NDArray

__all__ = ["Outcome", "is_right", "longest_gap", "outcomes"]


class Outcome(Enum):
    """The outcome of a fix. The order is the order of every legend and table."""

    TRUSTED_RIGHT = "trusted, right"
    TRUSTED_WRONG = "trusted, wrong"
    UNTRUSTED_RIGHT = "untrusted, right"
    UNTRUSTED_WRONG = "untrusted, wrong"

    @staticmethod
    def of(right: bool, trusted: bool) -> "Outcome":
        """The outcome of one fix."""
        if trusted:
            return Outcome.TRUSTED_RIGHT if right else Outcome.TRUSTED_WRONG
        return Outcome.UNTRUSTED_RIGHT if right else Outcome.UNTRUSTED_WRONG

    @property
    def right(self) -> bool:
        """Whether the place was the true one."""
        return self.name.endswith("_RIGHT")

    @property
    def trusted(self) -> bool:
        """Whether the match was trusted."""
        return self.name.startswith("TRUSTED")


def is_right(
    place: NDArray[np.int64], truth: NDArray[np.int64], tolerance: int = 1
) -> NDArray[np.bool_]:
    """Which matches are within ``tolerance`` places of the truth; none if the truth is -1, off
    the map.
    """
    near: NDArray[np.bool_] = np.abs(place - truth) <= tolerance
    return near & (truth >= 0)


def outcomes(
    right: NDArray[np.bool_], trusted: NDArray[np.bool_]
) -> dict[Outcome, NDArray[np.bool_]]:
    """Which queries had each outcome: four masks of shape (m,) that cover every query once."""
    return {outcome: (right == outcome.right) & (trusted == outcome.trusted) for outcome in Outcome}


def longest_gap(fixed: NDArray[np.bool_]) -> range:
    """The longest stretch of queries of which none is ``fixed``; the first, if two are as long."""
    edges = np.flatnonzero(np.concatenate(([True], fixed, [True])))
    starts, lengths = edges[:-1], np.diff(edges) - 1
    longest = int(np.argmax(lengths))
    return range(int(starts[longest]), int(starts[longest] + lengths[longest]))
