"""Distances to many places, and the belief in them, made short enough to draw."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from surefix import Fix

__all__ = ["Bins", "Columns"]


class Bins:
    """Neighbouring places that are drawn as one bar, pixel or character.

    A match is one place in a hundred thousand: a mean, or every hundredth place, would lose it.

    Parameters
    ----------
    places : int
    count : int
        The most bins, all of one width but the last.
    fill : bool
        Exactly ``count`` bins instead; on a short route, a place then has several of them.

    Examples
    --------
    >>> import numpy as np
    >>> bins = Bins(places=5, count=3)
    >>> bins.smallest(np.array([3, 1, 2, 2, 4], np.float32))
    array([1., 2., 4.], dtype=float32)
    >>> bins.of(3)
    1
    """

    def __init__(self, places: int, count: int, *, fill: bool = False) -> None:
        self.width = max(1, -(-places // count))
        self.first = np.arange(0, places, self.width)
        if fill:
            self.first = np.arange(count) * places // count

    def __len__(self) -> int:
        return len(self.first)

    def smallest(self, distances: NDArray[np.float32]) -> NDArray[np.float32]:
        """The smallest distance of each bin."""
        # Of bins that share a place, ``reduceat`` gives each that place's own value.
        return np.asarray(np.minimum.reduceat(distances, self.first), np.float32)

    def largest(self, values: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The largest value of each bin."""
        return np.asarray(np.maximum.reduceat(values, self.first), np.uint8)

    def sums(self, belief: NDArray[np.float64]) -> NDArray[np.float64]:
        """The belief in each bin; bins that share a place have all of it, each."""
        return np.asarray(np.add.reduceat(belief, self.first), np.float64)

    def of(self, place: int) -> int:
        """The bin of a place; the middle one of several."""
        left, right = (int(np.searchsorted(self.first, place, side)) for side in ("left", "right"))
        return (left + right - 1) // 2 if left < right else right - 1


class Columns:
    """The distances of the newest queries, the newest in the last column, and the matched cells.

    Parameters
    ----------
    places : int
        Of the map.
    count : int
        Columns kept; those that are not there yet are infinitely far.
    rows : int
        The most rows.
    """

    def __init__(self, places: int, count: int, rows: int) -> None:
        self.bins = Bins(places, rows)
        self.count = count
        self.values = np.full((len(self.bins), count), np.inf, np.float32)
        self.matched: deque[tuple[int, bool]] = deque(maxlen=count)

    def add(self, distances: NDArray[np.float32], fix: Fix) -> None:
        """Take the distances of the newest query, shape (places,), and its fix."""
        self.values[:, :-1] = self.values[:, 1:]
        self.values[:, -1] = self.bins.smallest(distances)
        self.matched.append((self.bins.of(fix.single.place), fix.trusted))

    def levels(self) -> NDArray[np.uint8]:
        """A picture (rows, count): 255 is the smallest distance in it, 1 the largest, 0 is none."""
        levels = np.zeros(self.values.shape, np.uint8)
        known = np.isfinite(self.values)
        if known.any():
            near, far = self.values[known].min(), self.values[known].max()
            span = far - near if far > near else np.float32(1)
            levels[known] = np.rint(255 - 254 * ((self.values[known] - near) / span))
        return levels

    def cells(self, trusted: bool) -> NDArray[np.float32]:
        """The middles of the matched cells, trusted or other: (n, 2), x right and y down."""
        first = self.count - len(self.matched)
        cells = [
            (first + k, row) for k, (row, trust) in enumerate(self.matched) if trust == trusted
        ]
        return np.array(cells, np.float32).reshape(-1, 2) + np.float32(0.5)
