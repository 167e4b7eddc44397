"""What surefix asks of a descriptor: images in, vectors out, a name, and the recipe that makes them
again.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from surefix.errors import SurefixValueError

__all__ = ["Descriptor", "as_images", "checked_rows", "require_descriptor"]

Image = npt.NDArray[np.uint8]
Rows = npt.NDArray[np.float32]


@runtime_checkable
class Descriptor(Protocol):
    """Turns images into vectors that are near one another where the places are the same.

    Anything with these three members is one; there is nothing to inherit from.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.descriptors import Descriptor
    >>> class Brightness:
    ...     name = "brightness"
    ...     recipe = {"name": "brightness"}
    ...     def describe(self, images):
    ...         return np.array([[image.mean(), image.std()] for image in images], np.float32)
    >>> isinstance(Brightness(), Descriptor)
    True
    """

    @property
    def name(self) -> str:
        """What a map made with it remembers: queries must be described by one of the same name.

        Or by one of the same recipe under another name, where the recipe has the ``sha256`` of a
        file, such as that of a network which was renamed.
        """
        ...

    @property
    def recipe(self) -> Mapping[str, object]:
        """What somebody needs to make the same vectors again, as JSON can hold it: files, sizes,
        statistics.
        """
        ...

    def describe(self, images: Sequence[npt.NDArray[np.uint8]]) -> npt.NDArray[np.float32]:
        """Images (H, W) or (H, W, 3), uint8, to (n, dim) float32; one image, as an array, to (1,
        dim).
        """
        ...


def require_descriptor(thing: object) -> Descriptor:
    """``thing``, where it is a descriptor.

    Raises
    ------
    SurefixValueError
        Where it lacks a member, which it names.
    """
    lacking = [member for member in ("name", "recipe", "describe") if not hasattr(thing, member)]
    if lacking or not isinstance(thing, Descriptor):
        raise SurefixValueError(
            f"descriptor: expected an object with name, recipe and describe(images), got {type(thing).__name__}"
            f" without {' and '.join(lacking)}"
        )
    return thing


def as_images(images: Any) -> list[Image]:
    """What ``describe`` takes, as a list: one image, an array of images, or a sequence of them.

    Raises
    ------
    SurefixValueError
        Where one is not uint8 (H, W) or (H, W, 3).
    """
    alone = isinstance(images, np.ndarray) and (
        images.ndim == 2 or (images.ndim == 3 and images.shape[2] == 3)
    )
    several = [images] if alone else list(images)
    return [
        checked_image(image, f"image {index} of the call") for index, image in enumerate(several)
    ]


def checked_image(image: Any, what: str) -> Image:
    """The image as an array, where it is one.

    Raises
    ------
    SurefixValueError
        Where it is not uint8 (H, W) or (H, W, 3), or has no pixels.
    """
    array = np.asarray(image)
    shape_fits = array.ndim == 2 or (array.ndim == 3 and array.shape[2] == 3)
    if array.dtype != np.uint8 or not shape_fits or 0 in array.shape:
        raise SurefixValueError(
            f"{what}: expected uint8 (H, W) or (H, W, 3), got {array.dtype} {array.shape}"
        )
    return array


def checked_rows(vectors: Any, images: int, what: str, names: Sequence[str] | None = None) -> Rows:
    """What a network or a descriptor gave for some images, where it is a finite vector an image.

    Raises ------ SurefixValueError Where it is something else; ``what`` says whose it is, and
    ``names`` what the images are called.
    """
    try:
        array = np.asarray(vectors)
        rows = np.ascontiguousarray(array, dtype=np.float32)
    except (TypeError, ValueError):
        raise SurefixValueError(
            f"{what}: expected numbers of the shape ({images}, dim), got {type(vectors).__name__}"
        ) from None
    if array.dtype.kind not in "fiu":
        raise SurefixValueError(f"{what}: expected numbers, got {array.dtype}")
    if rows.ndim != 2 or rows.shape[0] != images or rows.shape[1] == 0:
        raise SurefixValueError(
            f"{what}: expected a vector an image, ({images}, dim) for {images} images, got the shape {array.shape}"
        )
    # A sum is finite only where all are, and where it is not, that may be for its size alone.
    with np.errstate(over="ignore", invalid="ignore"):
        suspicious = ~np.isfinite(rows.sum(axis=1))
    for index in np.flatnonzero(suspicious).tolist():
        wrong = np.flatnonzero(~np.isfinite(rows[index]))
        if len(wrong):
            name = f"image {index} of the call" if names is None else names[index]
            raise SurefixValueError(
                f"{what}: expected finite numbers, got {rows[index][wrong[0]]} for {name}, at index {wrong[0]} of the "
                f"vector; {len(wrong)} of {rows.shape[1]} are not finite"
            )
    return rows
