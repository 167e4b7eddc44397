"""Images of more than 8 bits in 8: by the levels of a map."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix.errors import mismatch

Levels = tuple[int, int]
# All 16 bits: a 257th of each sample.
FULL: Levels = (0, 65535)
# As in the library: images that are looked at, and the share of samples at each end of one that may
# lie outside.
LOOKED_AT = 32
OUTLIERS = 1000


def in_8_bits(image: npt.NDArray[Any], levels: Any = None) -> npt.NDArray[Any]:
    """A uint16 image in uint8: ``levels`` are the samples that become black and white, all 16 bits
    by default. Images of other types are returned as they are.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.frames import in_8_bits
    >>> in_8_bits(np.array([[6000, 7000], [7255, 9000]], np.uint16), (7000, 7510)).tolist()
    [[0, 0], [128, 255]]
    """
    if image.dtype != np.uint16:
        return image
    low, high = checked_levels(FULL if levels is None else levels)
    above = (np.clip(image, low, high) - low).astype(np.uint32)
    scaled: npt.NDArray[Any] = ((above * 255 + (high - low) // 2) // (high - low)).astype(np.uint8)
    return scaled


def checked_levels(levels: Any) -> Levels:
    """The levels, if they are two samples, the first below the second."""
    try:
        low, high = (int(level) for level in levels)
    except (TypeError, ValueError):
        raise mismatch("levels", "(low, high), from 0 to 65535", repr(levels)) from None
    if not 0 <= low < high <= FULL[1]:
        raise mismatch("levels", "a low below a high, from 0 to 65535", f"{low} and {high}")
    return low, high


def measured(images: Iterable[npt.NDArray[Any]]) -> Levels | None:
    """The range of some images of a map, without 0.1 % at each end of each; None if they have 8
    bits.
    """
    low, high = FULL[1], 0
    deep = False
    for image in images:
        if image.dtype != np.uint16 or not image.size:
            continue
        ordered = np.sort(image, axis=None)
        out = ordered.size // OUTLIERS
        deep, low, high = True, min(low, int(ordered[out])), max(high, int(ordered[-1 - out]))
    if not deep:
        return None
    return min(low, FULL[1] - 1), max(high, min(low, FULL[1] - 1) + 1)


class Clipping:
    """Notices frames of more than 8 bits that do not fit the levels of a map.

    ``add`` each frame; ``warning`` is a line, or None if all is well.
    """

    # A drive in whose frames more than this share of the samples lies outside is worth a word.
    SHARE = 0.2
    # One frame in this many is looked at.
    EVERY = 8
    # Of the 256 levels: fewer are few. Images of 12 bits have no more, as a 257th is kept.
    FEW = 16

    def __init__(self, levels: Levels | None, every: int = EVERY) -> None:
        self.levels, self.every = levels, every
        self.frames = self.outside = self.samples = self.few = self.looked = 0

    def add(self, image: npt.NDArray[Any]) -> None:
        """Looks at some of the frames."""
        self.frames += 1
        if image.dtype != np.uint16 or (self.frames - 1) % self.every or not image.size:
            return
        self.looked += 1
        if self.levels is None:
            # Nearly all samples in a few levels.
            low, high = np.percentile(image, (5, 95))
            self.few += high - low < self.FEW * 257
            return
        low, high = self.levels
        self.samples += image.size
        self.outside += int(np.count_nonzero((image < low) | (image > high)))

    @property
    def warning(self) -> str | None:
        """What does not fit."""
        if self.levels is None and self.looked and 2 * self.few >= self.looked:
            return (
                "Warning: the frames have 16 bits, and the map's images had 8: a 257th of each "
                "sample leaves few levels; make the map of images of 16 bits"
            )
        if self.levels is not None and self.outside > self.SHARE * self.samples:
            share, (low, high) = self.outside / self.samples, self.levels
            return (
                f"Warning: {share:.0%} of the samples lie outside of the map's levels, {low} to "
                f"{high}: they are black or white; a map with --levels LOW HIGH fits more drives"
            )
        return None
