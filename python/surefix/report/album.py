"""Small images inside a page, each once, within a number of bytes."""

import base64
import io
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Pillow comes with Bokeh, and with matplotlib.
from PIL import Image, ImageOps

from surefix.errors import SurefixError

__all__ = ["BUDGET", "MOST", "Album", "fit"]

# In bytes of JPEG, of all images of a page: a page with them has less than 10 MB.
BUDGET = 4_800_000
# Images of an album. Of a longer drive every second, fourth, ... is kept.
MOST = 1200
# The longest side in pixels, and the quality, from the best on.
SIZES = ((160, 75), (160, 60), (128, 60), (112, 55), (96, 50), (80, 45), (64, 40))


class Album:
    """Images by their number, as JPEGs of at most 160 pixels; at most ``MOST`` of them.

    ``numbers`` and ``files`` are in ascending order of the numbers, if images are added so.
    """

    def __init__(self) -> None:
        self.numbers: list[int] = []
        self.files: list[bytes] = []
        self.step = 1

    def __len__(self) -> int:
        """The number of images."""
        return len(self.numbers)

    def wants(self, number: int) -> bool:
        """Whether the image of this number would be kept."""
        return number % self.step == 0

    def add(self, number: int, image: Any) -> None:
        """Takes an image, uint8 (H, W) or (H, W, 3), or a Pillow image; grey if it is grey."""
        if not self.wants(number):
            return
        self.numbers.append(number)
        self.files.append(_jpeg(image, *SIZES[0]))
        if len(self) > MOST:
            self.step *= 2
            kept = [k for k, each in enumerate(self.numbers) if self.wants(each)]
            self.numbers = [self.numbers[k] for k in kept]
            self.files = [self.files[k] for k in kept]

    @classmethod
    def of(cls, images: Any, numbers: Iterable[int]) -> "Album":
        """Some images of a sequence or a mapping; those that it lacks, or that cannot be read, are
        left out.
        """
        album, wanted = cls(), sorted({*numbers})
        paths = getattr(getattr(images, "given", images), "paths", None)
        for number in wanted[:: -(-len(wanted) // MOST) or 1]:
            try:
                album.add(number, _read(images, paths, number))
            except (KeyError, IndexError, OSError, SurefixError):
                continue
        return album

    def texts(self) -> list[str]:
        """The files in base64."""
        return [base64.b64encode(file).decode("ascii") for file in self.files]


def fit(albums: Iterable[Album], budget: int = BUDGET) -> None:
    """Makes the images of all albums smaller, and coarser, until they fit into ``budget`` bytes."""
    albums = list(albums)
    files = [file for album in albums for file in album.files]
    if sum(map(len, files)) <= budget:
        return
    some = files[:: max(1, len(files) // 24)]
    for size in SIZES[1:]:
        # With a little to spare, as it is judged by some of them.
        each = sum(len(_again(file, *size)) for file in some) / len(some)
        if each * len(files) <= 0.96 * budget:
            break
    for album in albums:
        album.files = [_again(file, *size) for file in album.files]


def _read(images: Any, paths: list[str] | None, number: int) -> Any:
    if paths is None or not paths[number].lower().endswith((".jpg", ".jpeg")):
        return images[number]
    try:
        with Image.open(paths[number]) as image:
            # Decodes an eighth, a quarter or a half of the pixels, if that is enough.
            image.draft(None, (2 * SIZES[0][0], 2 * SIZES[0][0]))
            return ImageOps.exif_transpose(image)
    except Image.DecompressionBombError:
        # The limit is surefix's own, which may be set higher.
        return images[number]


def _again(file: bytes, longest: int, quality: int) -> bytes:
    return _jpeg(Image.open(io.BytesIO(file)), longest, quality)


def _jpeg(image: Any, longest: int, quality: int) -> bytes:
    if not isinstance(image, Image.Image):
        pixels: NDArray[np.uint8] = np.ascontiguousarray(image)
        image = Image.fromarray(pixels[..., 0] if pixels.shape[2:] == (1,) else pixels)
    small = image if image.mode in ("L", "RGB") else image.convert("RGB")
    if max(small.size) > longest:
        scale = longest / max(small.size)
        width, height = (max(1, round(scale * side)) for side in small.size)
        small = small.resize((width, height), Image.Resampling.LANCZOS, reducing_gap=2.0)
    file = io.BytesIO()
    small.save(file, "JPEG", quality=quality, optimize=True)
    return file.getvalue()
