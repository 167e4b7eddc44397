"""A long vector of distances made short enough to draw, with its minima kept."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["Thinning"]


class Thinning:
    """Places in groups of neighbours, each drawn as the smallest of its distances.

    A match is one place in a hundred thousand: a mean, or every hundredth place, would lose it.

    Parameters ---------- places : int How many there are. size : int How many groups there may be.
    Where there are no more places than that, each has a group of its own.

    Examples
    --------
    >>> import numpy as np
    >>> thinning = Thinning(places=5, size=3)
    >>> distances = np.array([3, 1, 2, 2, 4], np.float32)
    >>> thinning.smallest(distances)
    array([1, 2, 4])
    >>> thinning.group(3)
    1
    """

    def __init__(self, places: int, size: int) -> None:
        self.places = places
        self.width = max(1, -(-places // size))
        self.groups = -(-places // self.width)

    def smallest(self, distances: NDArray[np.float32]) -> NDArray[np.int64]:
        """The place of each group's smallest distance, shape (groups,); the lowest of several."""
        if self.width == 1:
            return np.arange(self.places)
        padded = np.full(self.groups * self.width, np.inf, np.float32)
        padded[: self.places] = distances
        inside = padded.reshape(self.groups, self.width).argmin(axis=1)
        return np.asarray(inside + self.width * np.arange(self.groups), np.int64)

    def group(self, place: int) -> int:
        """The group that a place is in."""
        return place // self.width
