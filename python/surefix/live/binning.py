"""Distances to many places, and the belief in them, made short enough to draw."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from surefix import Fix

__all__ = ["Bins", "Columns", "ticks"]


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
    """The distances of the newest queries as a picture: the first place at the bottom, the newest
    query at the right; and the matched cells in it. The first few queries fill it in wide columns.

    Parameters
    ----------
    places : int
        Of the map.
    count : int
        Columns kept.
    rows : int
        The most rows.
    """

    def __init__(self, places: int, count: int, rows: int) -> None:
        self.bins = Bins(places, rows)
        self.count, self.rows = count, len(self.bins)
        self.values: deque[NDArray[np.float32]] = deque(maxlen=count)
        self.matched: deque[tuple[int, bool]] = deque(maxlen=count)

    def add(self, distances: NDArray[np.float32], fix: Fix) -> None:
        """Take the distances of the newest query, shape (places,), and its fix."""
        self.values.append(self.bins.smallest(distances))
        self.matched.append((self.bins.of(fix.single.place), fix.trusted))

    def levels(self) -> NDArray[np.uint8]:
        """A picture (rows, count): 255 is the smallest distance in it, 0 the largest."""
        values = np.array(self.values).T[::-1]
        near, far = values.min(), values.max()
        span = far - near if far > near else np.float32(1)
        levels = np.rint(255 - 255 * ((values - near) / span))
        wide = levels[:, np.arange(self.count) * len(self.values) // self.count]
        return np.asarray(wide, np.uint8)

    def cells(self, trusted: bool) -> NDArray[np.float32]:
        """The middles of the matched cells, trusted or other: (n, 2), x right and y down."""
        wide = self.count / len(self.matched)
        cells = [
            ((k + 0.5) * wide, self.height(row))
            for k, (row, trust) in enumerate(self.matched)
            if trust == trusted
        ]
        return np.array(cells, np.float32).reshape(-1, 2)

    def height(self, row: int) -> float:
        """The middle of a row, from the top."""
        return self.rows - row - 0.5


def ticks(places: int, most: int = 6) -> list[int]:
    """Round numbers of places, evenly apart, the first 0."""
    steps = (10**power * digit for power in range(10) for digit in (1, 2, 5))
    step = next(step for step in steps if step * most >= places)
    return list(range(0, places, step))
