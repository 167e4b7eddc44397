"""The route as a line of characters, from its start to its end."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["Strip"]


class Strip:
    """Which places each of ``width`` characters stands for. Strips of the same width line up.

    Examples
    --------
    >>> import numpy as np
    >>> strip = Strip(places=6, width=3)
    >>> strip.smallest(np.array([5, 1, 2, 2, 9, 4], np.float32))
    array([1., 2., 4.], dtype=float32)
    >>> strip.column(3)
    1
    """

    def __init__(self, places: int, width: int) -> None:
        self.width = max(1, width)
        # Of a short route, a place is several characters wide.
        self.first = np.arange(self.width) * places // self.width
        self.short = places < self.width

    def smallest(self, distances: NDArray[np.float32]) -> NDArray[np.float32]:
        """The smallest distance of each character's places, shape (width,)."""
        if self.short:
            return distances[self.first]
        return np.asarray(np.minimum.reduceat(distances, self.first), np.float32)

    def largest(self, values: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The largest value of each character's places, shape (width,)."""
        return (
            values[self.first]
            if self.short
            else np.asarray(np.maximum.reduceat(values, self.first), np.uint8)
        )

    def column(self, place: int) -> int:
        """The character of a place; the middle one of several."""
        left, right = (
            np.searchsorted(self.first, place, "left"),
            np.searchsorted(self.first, place, "right"),
        )
        return int((left + right - 1) // 2) if left < right else int(right - 1)
