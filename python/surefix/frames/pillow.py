"""Images of Pillow, as arrays."""

from typing import Any

import numpy as np
import numpy.typing as npt

from surefix.errors import SurefixValueError, mismatch


def pixels_of(image: Any, what: str = "image") -> npt.NDArray[Any]:
    """The pixels of an image of Pillow, upright, or of anything that NumPy takes."""
    # The images of pillow-heif are of a class made from Pillow's.
    of_pillow = any(each.__module__ == "PIL.Image" for each in type(image).__mro__)
    return array_of(image, what) if of_pillow else plain(np.asarray(image))


def plain(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """In this machine's order of bytes; an image (H, W, 1) as (H, W), and one (H, W, 4) without its
    alpha, as (H, W, 3).
    """
    native = array.astype(array.dtype.newbyteorder("="), copy=False)
    if native.ndim == 3 and native.shape[2] == 4:
        return native[..., :3]
    return native[..., 0] if native.ndim == 3 and native.shape[2] == 1 else native


def array_of(image: Any, what: str = "image") -> npt.NDArray[Any]:
    """The upright pixels of a ``PIL.Image.Image``: uint8 (H, W) or (H, W, 3), uint16 (H, W) of the
    modes of 16 bits.
    """
    from PIL import ImageOps

    try:
        upright = ImageOps.exif_transpose(image)
    except (OSError, SyntaxError) as error:
        raise SurefixValueError(f"{what}: cannot be decoded: {error}") from None
    mode = upright.mode
    if mode.startswith("I"):
        samples = np.asarray(upright)
        if samples.min(initial=0) < 0 or samples.max(initial=0) > 65535:
            got = f"{samples.min()} to {samples.max()} (mode {mode})"
            raise mismatch(what, "samples from 0 to 65535", got)
        return samples.astype(np.uint16)
    if mode == "F":
        expected = "a PIL image of 8 or 16 bits, such as np.uint16 for Image.fromarray"
        raise mismatch(what, expected, "floats (mode F)")
    return np.asarray(upright.convert("L" if mode in ("1", "L", "LA", "La") else "RGB"))
