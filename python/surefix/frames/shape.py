"""The shape of frames, width to height: cut to a map's, or compared with it."""

from collections.abc import Generator, Iterable
from contextlib import closing
from dataclasses import replace
from functools import partial
from typing import Any

import numpy.typing as npt

from surefix.errors import mismatch
from surefix.frames.frame import Frame, Shot
from surefix.frames.sampling import Derived

# Shapes are the same if they differ by less than this share.
SAME = 0.02


class Crop(Derived):
    """The frames of a source, cut around their centre to the shape of a size.

    Nothing is resized. Frames of that shape, and ready descriptors, are as they were.

    Parameters
    ----------
    source : iterable of Frame
    size : (int, int)
        Width and height, such as ``Map.image_size``.

    Raises
    ------
    SurefixValueError
        For a side below 1.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.frames import Crop, Frame
    >>> wide = [Frame(np.zeros((90, 160), np.uint8), None, "0")]
    >>> [frame.image.shape for frame in Crop(wide, (640, 480))]
    [(90, 120)]
    """

    def __init__(self, source: Iterable[Frame], size: tuple[int, int]) -> None:
        super().__init__(source)
        width, height = size
        if not (width > 0 and height > 0):
            raise mismatch("size", "a width and a height above 0", f"{width} x {height}")
        self.size = width, height
        self._count, self._estimate = self.source.count, self.source.estimate

    def shots(self) -> Generator[Shot, None, None]:
        """All, cut when they are read."""
        with closing(self.source.shots()) as shots:
            for shot in shots:
                # Without the path: whoever reads the file would have all of it.
                yield replace(shot, read=partial(_cut, shot, self.size), path=None)


def _cut(shot: Shot, size: tuple[int, int]) -> npt.NDArray[Any]:
    return cropped(shot.read(), size)


def cropped(image: npt.NDArray[Any], size: tuple[int, int]) -> npt.NDArray[Any]:
    """The greatest part around the centre that has the shape of ``size``."""
    if image.ndim < 2 or same_shape(image.shape[1::-1], size):
        return image
    height, width = image.shape[:2]
    wanted = size[0] / size[1]
    wide, high = min(width, round(height * wanted)), min(height, round(width / wanted))
    left, top = (width - wide) // 2, (height - high) // 2
    return image[top : top + max(high, 1), left : left + max(wide, 1)]


def same_shape(one: tuple[int, ...], other: tuple[int, ...]) -> bool:
    """Whether two sizes, (width, height), have one shape."""
    return abs(one[0] * other[1] / (one[1] * other[0]) - 1) <= SAME


def other_shape(size: tuple[int, int] | None, image: npt.NDArray[Any]) -> str | None:
    """A warning if an image has another shape than those of a map; None if all is well."""
    if size is None or image.ndim < 2 or not image.size or same_shape(image.shape[1::-1], size):
        return None
    height, width = image.shape[:2]
    return (
        f"Warning: the frames are {width} x {height} pixels ({width / height:.2f} to 1), the map's "
        f"images {size[0]} x {size[1]} ({size[0] / size[1]:.2f} to 1), so that they are squeezed; "
        "--crop cuts frames to the map's shape"
    )
