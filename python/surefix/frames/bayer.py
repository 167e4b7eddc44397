"""From a camera's Bayer mosaic to a colour image."""

from typing import Any, Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from surefix.errors import mismatch

Pattern: TypeAlias = Literal["rggb", "grbg", "gbrg", "bggr"]


def demosaic(mosaic: npt.NDArray[Any], pattern: Pattern = "gbrg") -> npt.NDArray[Any]:
    """The colour image of a Bayer mosaic, of half its sides.

    Each 2 x 2 cell becomes one pixel: its red, the mean of its two greens (halves up), its blue.
    Descriptors are made of small images: no detail that they use is lost.

    Parameters
    ----------
    mosaic : array of uint8 or uint16, shape (H, W)
    pattern : {"rggb", "grbg", "gbrg", "bggr"}
        The colours of the upper left 2 x 2 cell, row by row.

    Returns
    -------
    array of the same type, shape (H // 2, W // 2, 3), RGB

    Raises
    ------
    SurefixValueError
        For another type or shape, odd sides, or an unknown pattern.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.datasets import demosaic
    >>> cell = np.array([[10, 200], [100, 12]], np.uint8)       # G B / R G
    >>> demosaic(cell, "gbrg").tolist()
    [[[100, 11, 200]]]
    """
    if mosaic.dtype not in (np.uint8, np.uint16) or mosaic.ndim != 2:
        raise mismatch("mosaic", "uint8 or uint16 (H, W)", f"{mosaic.dtype} {mosaic.shape}")
    height, width = mosaic.shape
    if height % 2 or width % 2 or not mosaic.size:
        raise mismatch("mosaic", "sides of an even number of pixels", f"{height} x {width}")
    if pattern not in get_args(Pattern):
        raise mismatch("pattern", f"one of {', '.join(get_args(Pattern))}", repr(pattern))
    cells = {0: mosaic[::2, ::2], 1: mosaic[::2, 1::2], 2: mosaic[1::2, ::2], 3: mosaic[1::2, 1::2]}
    red, green, blue = (
        [cells[at] for at, colour in enumerate(pattern) if colour == wanted] for wanted in "rgb"
    )
    mean = (green[0].astype(np.uint32) + green[1] + 1) >> 1
    return np.stack([red[0], mean.astype(mosaic.dtype), blue[0]], axis=2)
