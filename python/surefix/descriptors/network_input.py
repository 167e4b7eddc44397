"""Images as networks take them: resized, three channels, normalised, (n, 3, H, W) float32."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix._extra import require
from surefix.errors import mismatch

# Of RGB / 255 over ImageNet, which nearly all backbones are trained on.
IMAGENET_MEAN = (0.485, 0.456, 0.406)
IMAGENET_STD = (0.229, 0.224, 0.225)
CHANNELS = 3


class NetworkInput:
    """Makes a network's input of images: resized to (width, height) by Pillow's antialiased
    ``resample``, divided by 255, and normalised by ``mean`` and ``std``; None leaves a step out.
    """

    def __init__(
        self,
        size: tuple[int, int] | None,
        mean: Sequence[float] | None,
        std: Sequence[float] | None,
        resample: str = "bilinear",
    ) -> None:
        if (mean is None) != (std is None):
            raise mismatch("mean, std", "both or neither", "std" if mean is None else "mean")
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
        numbers = {"size": self.size, "mean": self.mean, "std": self.std}
        lists = {key: None if value is None else list(value) for key, value in numbers.items()}
        return {**lists, "resample": self.resample}

    def batch(self, images: Sequence[npt.NDArray[np.uint8]]) -> npt.NDArray[np.float32]:
        """The images as one array (n, 3, H, W). Grey becomes three equal channels."""
        small = [self._resized(image) for image in images]
        height, width = small[0].shape[:2]
        planes = np.empty((len(small), CHANNELS, height, width), np.float32)
        for index, (plane, image) in enumerate(zip(planes, small, strict=True)):
            if image.shape[:2] != (height, width):
                got = f"{image.shape[1]} x {image.shape[0]}; give size=(width, height)"
                where, expected = f"image {index} of the batch", f"{width} x {height} as the first"
                raise mismatch(where, expected, got)
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
        if int(width) == width >= 1 and int(height) == height >= 1:
            return int(width), int(height)
    except (TypeError, ValueError):
        pass
    raise mismatch("size", "(width, height) in pixels", repr(size))


def _three(name: str, values: Any) -> tuple[float, float, float]:
    try:
        red, green, blue = (float(value) for value in values)
    except (TypeError, ValueError):
        raise mismatch(name, "three numbers, of red, green and blue", repr(values)) from None
    if not np.isfinite([red, green, blue]).all():
        raise mismatch(name, "finite numbers", repr(values))
    return red, green, blue
