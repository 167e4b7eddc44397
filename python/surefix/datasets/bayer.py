"""From a camera's Bayer mosaic to a colour image."""

from functools import lru_cache
from typing import Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from surefix.errors import SurefixValueError

__all__ = ["Method", "Pattern", "demosaic"]

Pattern: TypeAlias = Literal["rggb", "grbg", "gbrg", "bggr"]
Method: TypeAlias = Literal["superpixel", "bilinear"]

_RED, _GREEN, _BLUE = range(3)


def demosaic(
    mosaic: npt.NDArray[np.uint8], pattern: Pattern = "gbrg", method: Method = "superpixel"
) -> npt.NDArray[np.uint8]:
    """The colour image of a Bayer mosaic.

    ``superpixel``: each 2 x 2 cell becomes one pixel: its red, the mean of its two greens (halves
    up), its blue. The image has half the width and height, and nothing in it is invented.

    ``bilinear``: a colour's own sample where there is one; elsewhere the mean of its nearest two or
    four samples in the 3 x 3 around (halves up), at the border of those inside. The image keeps its
    size.

    Parameters
    ----------
    mosaic : array of uint8, shape (H, W)
    pattern : {"rggb", "grbg", "gbrg", "bggr"}
        The colours of the upper left 2 x 2 cell, row by row.
    method : {"superpixel", "bilinear"}

    Returns
    -------
    array of uint8, shape (H // 2, W // 2, 3) or (H, W, 3), RGB

    Raises
    ------
    SurefixValueError
        For another type or shape, odd sides, or an unknown pattern or method.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.datasets import demosaic
    >>> cell = np.array([[10, 200], [100, 12]], np.uint8)       # G B / R G
    >>> demosaic(cell, "gbrg").tolist()
    [[[100, 11, 200]]]
    """
    if mosaic.dtype != np.uint8 or mosaic.ndim != 2:
        raise SurefixValueError(f"mosaic: expected uint8 (H, W), got {mosaic.dtype} {mosaic.shape}")
    height, width = mosaic.shape
    if height % 2 or width % 2 or not mosaic.size:
        raise SurefixValueError(
            f"mosaic: expected sides of an even number of pixels, got {height} x {width}"
        )
    if pattern not in get_args(Pattern):
        raise SurefixValueError(
            f"pattern: expected one of {', '.join(get_args(Pattern))}, got {pattern!r}"
        )
    if method == "superpixel":
        return _superpixel(mosaic, pattern)
    if method == "bilinear":
        return _bilinear(mosaic, pattern)
    raise SurefixValueError(
        f"demosaic: expected one of {', '.join(get_args(Method))}, got {method!r}"
    )


def _sites(pattern: Pattern) -> list[list[tuple[int, int]]]:
    """Of red, green and blue: where in the 2 x 2 cell its samples are, as (row, column)."""
    return [
        [divmod(at, 2) for at, colour in enumerate(pattern) if colour == wanted] for wanted in "rgb"
    ]


def _superpixel(mosaic: npt.NDArray[np.uint8], pattern: Pattern) -> npt.NDArray[np.uint8]:
    red, green, blue = (
        [mosaic[row::2, column::2] for row, column in sites] for sites in _sites(pattern)
    )
    both = green[0].astype(np.uint16) + green[1]
    return np.stack([red[0], ((both + 1) >> 1).astype(np.uint8), blue[0]], axis=2)


def _bilinear(mosaic: npt.NDArray[np.uint8], pattern: Pattern) -> npt.NDArray[np.uint8]:
    image = np.empty((*mosaic.shape, 3), np.uint8)
    for colour, sites in enumerate(_sites(pattern)):
        samples = np.zeros(mosaic.shape, np.uint16)
        for row, column in sites:
            samples[row::2, column::2] = mosaic[row::2, column::2]
        weight = _weight(mosaic.shape, pattern, colour)
        image[..., colour] = (2 * _smooth(samples) + weight) // (2 * weight)
        for row, column in sites:
            image[row::2, column::2, colour] = mosaic[row::2, column::2]
    return image


@lru_cache(maxsize=16)
def _weight(shape: tuple[int, int], pattern: Pattern, colour: int) -> npt.NDArray[np.uint16]:
    """The sum of the weights of a colour's samples around each pixel: at least 1, because sides are
    even.
    """
    present = np.zeros(shape, np.uint16)
    for row, column in _sites(pattern)[colour]:
        present[row::2, column::2] = 1
    return _smooth(present)


def _smooth(plane: npt.NDArray[np.uint16]) -> npt.NDArray[np.uint16]:
    """The sum over the 3 x 3 around each pixel with the weights 1 2 1 down and across; nothing
    beyond the border.
    """
    for axis in (0, 1):
        lines = plane.swapaxes(0, axis)
        total = 2 * lines
        total[1:] += lines[:-1]
        total[:-1] += lines[1:]
        plane = total.swapaxes(0, axis)
    return plane
