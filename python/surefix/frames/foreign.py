"""Image files of formats that other libraries read: ``surefix[heif]``."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy.typing as npt

from surefix._core import read_image
from surefix.errors import SurefixValueError, refusal
from surefix.frames.pillow import array_of
from surefix.frames.pixels import check_pixels
from surefix.tables.regular import check_regular


@cache
def endings() -> tuple[str, ...]:
    """The endings of the formats whose library is installed."""
    try:
        from PIL import features
    except ModuleNotFoundError:
        return ()
    known = ("avif",) if features.check("avif") else ()
    try:
        import pillow_heif
    except ModuleNotFoundError:
        return known
    pillow_heif.register_heif_opener()
    return (*known, "heic", "heif")


def is_foreign(path: str) -> bool:
    """Whether another library reads this file."""
    return Path(path).suffix.lower().removeprefix(".") in endings()


def read_any(path: str) -> npt.NDArray[Any]:
    """The upright pixels of an image file, by whichever library reads it."""
    if not is_foreign(path):
        return read_image(path)
    from PIL import Image

    check_regular(path, "cannot read the image")
    try:
        with Image.open(path) as image:
            check_pixels(*image.size, f"image {path}")
            return array_of(image, path)
    except Image.DecompressionBombError as error:
        raise SurefixValueError(f"image {path}: {error}") from None
    except (SyntaxError, ValueError, RuntimeError) as error:
        raise SurefixValueError(f"image {path}: {error}") from None
    except OSError as error:
        # Pillow has no other word for a damaged image.
        if error.errno is None:
            raise SurefixValueError(f"image {path}: {error}") from None
        raise refusal(path, "cannot read the image", error) from None
