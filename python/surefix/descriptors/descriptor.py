"""The protocol of a descriptor: images in, vectors out, a name, and a recipe."""

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from surefix.errors import mismatch
from surefix.frames.levels import in_8_bits
from surefix.frames.pillow import pixels_of

Image = npt.NDArray[np.uint8]
Rows = npt.NDArray[np.float32]


@runtime_checkable
class Descriptor(Protocol):
    """Turns images into vectors that are near one another if the places are the same.

    Any class with these three members is one; there is nothing to inherit from.

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
        """Kept in the map: queries must be described by a descriptor of the same name.

        Or of the same recipe under another name, if the recipe has the ``sha256`` of a file, such
        as that of a network which was renamed.
        """
        ...

    @property
    def recipe(self) -> Mapping[str, object]:
        """All that it takes to make the same vectors again, as JSON: files, sizes, statistics."""
        ...

    def describe(self, images: Sequence[npt.NDArray[np.uint8]]) -> npt.NDArray[np.float32]:
        """Images (H, W) or (H, W, 3), uint8, to (n, dim) float32; one image, as an array, to (1,
        dim).
        """
        ...


def require_descriptor(thing: object) -> Descriptor:
    """``thing``, if it is a descriptor; the error names the missing members."""
    lacking = [member for member in ("name", "recipe", "describe") if not hasattr(thing, member)]
    if lacking or not isinstance(thing, Descriptor):
        got = f"{type(thing).__name__} without {' and '.join(lacking)}"
        raise mismatch("descriptor", "an object with name, recipe and describe(images)", got)
    return thing


def in_batches(images: Any, size: int, run: Callable[[list[Image], int], Rows]) -> Rows:
    """Describes an image or several, ``size`` at a time: ``run(images, index of the first)``."""
    alone = isinstance(images, np.ndarray) and _has_image_shape(images)
    several = [images] if alone else list(images)
    if not several:
        raise mismatch("images", "at least one", "none")
    checked = [checked_image(image, f"image {i} of the call") for i, image in enumerate(several)]
    parts = [run(checked[start : start + size], start) for start in range(0, len(checked), size)]
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def checked_batch(batch: object) -> int:
    """A number of images, at least 1."""
    if not isinstance(batch, int) or batch < 1:
        raise mismatch("batch", "a whole number of at least 1", repr(batch))
    return batch


def _has_image_shape(array: npt.NDArray[Any]) -> bool:
    return array.ndim == 2 or (array.ndim == 3 and array.shape[2] in (1, 3, 4))


def checked_image(image: Any, what: str) -> Image:
    """The image as an array, if it is uint8 or uint16 (H, W) or (H, W, 3) and has pixels; in 8
    bits, and without alpha.
    """
    array = in_8_bits(pixels_of(image, what))
    if array.dtype != np.uint8 or not _has_image_shape(array) or 0 in array.shape:
        raise mismatch(what, "uint8 (H, W) or (H, W, 3)", f"{array.dtype} {array.shape}")
    return array


def check_one_each(shape: tuple[int, ...], images: int, what: str) -> None:
    """Refuses the shape of an output that is not a vector an image."""
    if len(shape) < 2 or shape[0] != images:
        expected = f"a vector an image, ({images}, ...) for {images} images"
        raise mismatch(what, expected, f"the shape {shape}")


def checked_rows(vectors: Any, images: int, what: str, names: Sequence[str] | None = None) -> Rows:
    """The output of the network ``what`` for some images, if it is a finite vector an image."""
    try:
        array = np.asarray(vectors)
        rows = np.ascontiguousarray(array, dtype=np.float32)
    except (TypeError, ValueError):
        expected = f"numbers of the shape ({images}, dim)"
        raise mismatch(what, expected, type(vectors).__name__) from None
    if array.dtype.kind not in "fiu":
        raise mismatch(what, "numbers", array.dtype)
    if rows.ndim != 2 or rows.shape[0] != images or rows.shape[1] == 0:
        expected = f"a vector an image, ({images}, dim) for {images} images"
        raise mismatch(what, expected, f"the shape {array.shape}")
    # A finite sum has finite terms only. An infinite one may still be of large finite terms.
    with np.errstate(over="ignore", invalid="ignore"):
        suspicious = ~np.isfinite(rows.sum(axis=1))
    for index in np.flatnonzero(suspicious).tolist():
        wrong = np.flatnonzero(~np.isfinite(rows[index]))
        if len(wrong):
            name = f"image {index} of the call" if names is None else names[index]
            got = f"{rows[index][wrong[0]]} for {name}, at index {wrong[0]} of the vector"
            count = f"{len(wrong)} of {rows.shape[1]} are not finite"
            raise mismatch(what, "finite numbers", f"{got}; {count}")
    return rows


def recipe_of(descriptor: Any) -> dict[str, Any]:
    """The recipe that a map keeps of a descriptor."""
    return {**descriptor.recipe, "name": descriptor.name}


def same_vectors(one: Mapping[str, object], other: Mapping[str, object]) -> bool:
    """Whether two recipes are equal; the names of a file whose SHA-256 both have do not count, nor
    does where weights that both have the SHA-256 of were read from.
    """
    first, second = (json.loads(json.dumps(dict(recipe))) for recipe in (one, other))
    if "weights_sha256" in first and "weights_sha256" in second:
        for recipe in (first, second):
            recipe.pop("weights", None)
    if first == second:
        return True
    if "sha256" not in first or "sha256" not in second:
        return False
    for recipe in (first, second):
        for label in ("name", "file"):
            recipe.pop(label, None)
    return bool(first == second)
