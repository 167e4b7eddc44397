"""The newest columns of the distance matrix, with the matched cells: bounded, however long the
drive.
"""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from surefix import Fix
from surefix.live.thinning import Thinning

__all__ = ["Columns"]


class Columns:
    """The last ``count`` queries' distances, thinned to at most ``rows`` rows.

    The newest is the rightmost column; those that are not there yet are as far as can be.

    Parameters
    ----------
    places : int
        Of the map.
    count : int
        Columns kept.
    rows : int
        Rows at most.
    """

    def __init__(self, places: int, count: int, rows: int) -> None:
        self.thinning = Thinning(places, rows)
        self.count = count
        self.values = np.full((self.thinning.groups, count), np.inf, np.float32)
        self.matched: deque[tuple[int, bool]] = deque(maxlen=count)

    def add(self, distances: NDArray[np.float32], fix: Fix) -> None:
        """Take the distances of the newest query, shape (places,), and its fix."""
        self.values[:, :-1] = self.values[:, 1:]
        self.values[:, -1] = distances[self.thinning.smallest(distances)]
        self.matched.append((self.thinning.group(fix.single.place), fix.trusted))

    def levels(self) -> NDArray[np.uint8]:
        """The columns as a picture, (rows, count): 255 is the smallest distance in it, 1 the
        largest, 0 is none.
        """
        known = np.isfinite(self.values)
        if not known.any():
            return np.zeros(self.values.shape, np.uint8)
        near, far = self.values[known].min(), self.values[known].max()
        span = far - near if far > near else np.float32(1)
        levels = np.zeros(self.values.shape, np.uint8)
        levels[known] = np.rint(255 - 254 * ((self.values[known] - near) / span))
        return levels

    def cells(self, trusted: bool) -> NDArray[np.float32]:
        """The middles of the matched cells that are trusted, or those that are not: (n, 2), x right
        and y down.
        """
        first = self.count - len(self.matched)
        cells = [
            (first + k, row) for k, (row, trust) in enumerate(self.matched) if trust == trusted
        ]
        return np.array(cells, np.float32).reshape(-1, 2) + np.float32(0.5)
