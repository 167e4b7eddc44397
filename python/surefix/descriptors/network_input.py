"""Images as networks take them: resized, three channels, normalised, (n, 3, H, W) float32."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix._extra import require
from surefix.errors import SurefixValueError, mismatch

# Of RGB / 255 over ImageNet, which nearly all backbones are trained on.
IMAGENET_MEAN = (0.485, 0.456, 0.406)
IMAGENET_STD = (0.229, 0.224, 0.225)
CHANNELS = 3


class NetworkInput:
    """Makes a network's input of images, by Pillow's antialiased resizing.

    Parameters
    ----------
    size : (int, int), optional
        Width and height; None leaves images as they are.
    mean, std : three floats, optional
        Of RGB / 255; None for both leaves values from 0 to 1.
    resample : {"bilinear", "bicubic"}

    Raises
    ------
    SurefixValueError
        If one of them is something else.
    """

    def __init__(
        self,
        size: tuple[int, int] | None,
        mean: Sequence[float] | None,
        std: Sequence[float] | None,
        resample: str = "bilinear",
    ) -> None:
        if (mean is None) != (std is None):
            raise SurefixValueError(
                "mean, std: expected both or neither, got " + ("std" if mean is None else "mean")
            )
        if resample not in ("bilinear", "bicubic"):
            raise mismatch("resample", '"bilinear" or "bicubic"', repr(resample))
        self.size = None if size is None else _checked_size(size)
        self.mean = None if mean is None else _three("mean", mean)
        self.std = None if std is None else _three("std", std)
        self.resample = resample
        if self.std is not None and min(self.std) <= 0:
            raise mismatch("std", "numbers above 0", self.std)

    @property
    def recipe(self) -> dict[str, object]:
        """For a descriptor's recipe."""
        return {
            "size": None if self.size is None else list(self.size),
            "mean": None if self.mean is None else list(self.mean),
            "std": None if self.std is None else list(self.std),
            "resample": self.resample,
        }

    def batch(self, images: Sequence[npt.NDArray[np.uint8]]) -> npt.NDArray[np.float32]:
        """The images (H, W) or (H, W, 3), uint8, as one array (n, 3, H, W). Grey becomes three
        equal channels. Without a ``size``, all must have the size of the first.
        """
        small = [self._resized(image) for image in images]
        height, width = small[0].shape[:2]
        planes = np.empty((len(small), CHANNELS, height, width), np.float32)
        for index, (plane, image) in enumerate(zip(planes, small, strict=True)):
            if image.shape[:2] != (height, width):
                raise SurefixValueError(
                    f"image {index} of the batch: expected {width} x {height} as the first, got "
                    f"{image.shape[1]} x {image.shape[0]}; give size=(width, height)"
                )
            plane[:] = image if image.ndim == 2 else image.transpose(2, 0, 1)
        # A multiplication and an addition a number: (x / 255 - mean) / std.
        planes *= np.float32(1 / 255)
        if self.mean is not None and self.std is not None:
            planes -= np.array(self.mean, np.float32).reshape(CHANNELS, 1, 1)
            planes /= np.array(self.std, np.float32).reshape(CHANNELS, 1, 1)
        return planes

    def _resized(self, image: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
        height, width = image.shape[:2]
        if self.size is None or self.size == (width, height):
            return image
        pillow = require("PIL.Image", "resizing images for a network", "Pillow", "surefix[learned]")
        resample = pillow.Resampling[self.resample.upper()]
        return np.asarray(pillow.fromarray(image).resize(self.size, resample))


def _checked_size(size: Any) -> tuple[int, int]:
    try:
        width, height = size
        whole = int(width) == width and int(height) == height
    except (TypeError, ValueError):
        raise mismatch("size", "(width, height) in pixels", repr(size)) from None
    if not whole or width < 1 or height < 1:
        raise mismatch("size", "(width, height) in pixels", repr(size))
    return int(width), int(height)


def _three(name: str, values: Any) -> tuple[float, float, float]:
    try:
        red, green, blue = (float(value) for value in values)
    except (TypeError, ValueError):
        raise mismatch(name, "three numbers, of red, green and blue", repr(values)) from None
    if not np.isfinite([red, green, blue]).all():
        raise mismatch(name, "finite numbers", repr(values))
    return red, green, blue
