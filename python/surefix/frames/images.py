"""Images that are all at hand: files, or the rows of an array."""

import os
from abc import ABC, abstractmethod
from collections.abc import Generator, Iterable, Sequence
from copy import copy
from functools import partial
from operator import index as as_index
from pathlib import Path
from typing import Any, Self, SupportsIndex, overload

import numpy as np
import numpy.typing as npt

from surefix._core import Traverse, image_files
from surefix.errors import SurefixValueError, mismatch
from surefix.frames.bayer import Pattern, demosaic
from surefix.frames.foreign import endings, is_foreign, read_any
from surefix.frames.frame import Frames, Shot
from surefix.frames.levels import in_8_bits
from surefix.frames.pillow import pixels_of, plain
from surefix.tables.npy import read_npy
from surefix.tables.vectors import ENDINGS, check_no_key, load

UInt8 = npt.NDArray[np.uint8]
Place = str | os.PathLike[str]
# Of an image: grey, RGB, and RGB with alpha.
CHANNELS = (1, 3, 4)


class Images(Sequence[UInt8], ABC):
    """Images in route order, loaded lazily: ``images[i]`` is uint8, (H, W) grey or (H, W, 3) RGB;
    uint16 of more than 8 bits.

    ``Map.from_images`` and ``match`` take them as they are, and then hold all at once. If ``paths``
    is not None, give them that instead: plain image files are read and described in parallel, a few
    at a time.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.datasets import ImageArray
    >>> route = ImageArray(np.zeros((3, 4, 6), np.uint8))
    >>> len(route), route[-1].shape, route.names, len(route[1:])
    (3, (4, 6), ['0', '1', '2'], 2)
    """

    def __init__(self, items: Any, names: Iterable[str]) -> None:
        self._items, self._names = items, list(names)

    @property
    def names(self) -> list[str]:
        """The name of each image: its file's name, or its number."""
        return list(self._names)

    @property
    def paths(self) -> list[str] | None:
        """The plain image files; None if reading them takes this class."""
        return None

    def take(self, indices: npt.ArrayLike) -> Self:
        """The images of some indices, in their order."""
        return self._take([as_index(i) for i in np.asarray(indices, dtype=np.int64)])

    def __len__(self) -> int:
        return len(self._names)

    @overload
    def __getitem__(self, key: SupportsIndex) -> UInt8: ...
    @overload
    def __getitem__(self, key: slice) -> Self: ...
    def __getitem__(self, key: SupportsIndex | slice) -> UInt8 | Self:
        if isinstance(key, slice):
            return self._take(range(len(self))[key])
        return self._load(self._items[range(len(self))[as_index(key)]])

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self)} images)"

    @abstractmethod
    def _load(self, item: Any) -> UInt8: ...

    def _take(self, indices: Iterable[int]) -> Self:
        taken, chosen = copy(self), list(indices)
        taken._items = [self._items[i] for i in chosen]
        taken._names = [self._names[i] for i in chosen]
        return taken


class ImageFiles(Images):
    """Image files: png, jpeg, bmp, tiff, webp or pnm; with ``surefix[heif]`` heic and avif too, and
    then ``paths`` is None.
    """

    def __init__(self, paths: Iterable[Place]) -> None:
        files = [os.fspath(path) for path in paths]
        super().__init__(files, map(_name_of, files))

    @property
    def paths(self) -> list[str] | None:
        return None if any(map(is_foreign, self._items)) else list(self._items)

    def _load(self, item: str) -> UInt8:
        return read_any(item)


def _name_of(path: str) -> str:
    """As the library has it: what is no UTF-8 is written as U+FFFD."""
    return os.fsencode(Path(path).name).decode("utf-8", "replace")


class BayerFiles(ImageFiles):
    """Grey image files that hold a Bayer mosaic; ``images[i]`` is the colour image of half its
    sides. ``paths`` is None on purpose.
    """

    def __init__(self, paths: Iterable[Place], pattern: Pattern) -> None:
        super().__init__(paths)
        self.pattern: Pattern = pattern

    @property
    def paths(self) -> None:
        return None

    def _load(self, item: str) -> UInt8:
        try:
            return demosaic(in_8_bits(super()._load(item)), self.pattern)
        except SurefixValueError as error:
            raise SurefixValueError(f"{item}: {error}") from None


class ImageArray(Images):
    """Images that lie in one array, (n, H, W) or (n, H, W, 3) uint8 or uint16, in memory or
    memory-mapped. Of (n, H, W, 4) alpha is left out, and (n, H, W, 1) is grey.
    """

    def __init__(
        self, array: npt.NDArray[Any] | Sequence[UInt8], names: Iterable[str] | None = None
    ) -> None:
        super().__init__(array, map(str, range(len(array))) if names is None else names)

    def _load(self, item: UInt8) -> UInt8:
        return np.array(plain(item))


class ShownImages(Images):
    """Images in 8 bits, by the levels of a map; ``given`` are the images as they are."""

    def __init__(self, images: Images, levels: tuple[int, int] | None) -> None:
        super().__init__(range(len(images)), images.names)
        self.given, self._levels = images, levels

    def _load(self, item: int) -> UInt8:
        return in_8_bits(self.given[item], self._levels)


class ImageFrames(Frames):
    """The images of a folder or a pattern, ``frame9`` before ``frame10``; of a list, in its order;
    or the rows of an array in a file. No times.

    Parameters
    ----------
    place : str or path, or iterable of them
        A folder, a pattern like ``route/*.png``, or a list of files. Or a ``.npy`` of uint8 or
        uint16 images, (n, H, W) or (n, H, W, 3), or of ready descriptors, (n, dim); these also in
        the other files that ``surefix.descriptors.load`` reads.
    key : str, optional
        As for ``surefix.descriptors.load``.
    order : str
        Of a folder or a pattern, as for ``surefix.find_images``.

    Attributes
    ----------
    images : Images
        The same, for reading in any order.

    Raises
    ------
    SurefixFileError
        If there is no such folder or file; for a file of a list when its turn comes.
    SurefixValueError
        If it has no images or is no such array; if one cannot be decoded when its turn comes.
    """

    parallel = True

    def __init__(
        self, place: Place | Iterable[Place], key: str | None = None, *, order: str = "name"
    ) -> None:
        self._array: npt.NDArray[Any] | None = None
        self._remarks: list[str] = []
        name = os.fspath(place) if isinstance(place, (str, os.PathLike)) else None
        if name is not None and Path(name).suffix.lower() in ENDINGS:
            self._array, self._files = _load_array(name, key), [name]
            self.images: Images = ImageArray(self._array)
        elif key is not None:
            raise mismatch("key", "a file of descriptors", place)
        else:
            files: Any = place
            if name is not None:
                files, self._remarks = image_files(name, order, list(endings()))
            self._files = [os.fspath(file) for file in files]
            self.images = ImageFiles(self._files)
        self._count = len(self.images)

    @property
    def remarks(self) -> list[str]:
        """What to know of a folder or a pattern: the files that were left out, an order that the
        names leave open, two drives in one folder, files of which only the first image is taken.
        """
        return list(self._remarks)

    @property
    def ready(self) -> npt.NDArray[Any] | None:
        """The array, if its rows are ready descriptors."""
        return None if self._array is None or self._array.ndim != 2 else self._array

    @property
    def source(self) -> list[str] | Images | npt.NDArray[Any]:
        """As ``Map.from_images`` takes them, to be read in parallel: the files, or the array. Some
        of an array keep its numbers as their names.
        """
        if self._array is not None:
            all_ = self.images.names == [str(index) for index in range(len(self.images))]
            return self._array if all_ else self.images
        return self.images if self.images.paths is None else self.files

    def taken(self, indices: Iterable[int]) -> "ImageFrames":
        """Some of them, in this order."""
        some, chosen = copy(self), list(indices)
        some.images, some._count = self.images.take(chosen), len(chosen)
        if self._array is None:
            some._files = [self._files[index] for index in chosen]
        else:
            some._array = self._array[chosen]
        return some

    def shots(self) -> Generator[Shot, None, None]:
        """Each image, by its file's name or its number."""
        yield from _shots_of_images(self.images)


class _GivenFrames(Frames):
    """Images in memory, files, frames, or a mixture of them, one after the other."""

    parallel = True

    def __init__(self, images: Any) -> None:
        self._images = ImageArray(images) if isinstance(images, np.ndarray) else images
        self._count = len(images) if _is_counted(images) else None

    def shots(self) -> Generator[Shot, None, None]:
        # The classes of surefix may be read by several threads; others are read here, in order.
        if isinstance(self._images, (Images, Traverse)):
            yield from _shots_of_images(self._images)
            return
        counted = (self._images[i] for i in range(self._count or 0))
        for index, thing in enumerate(self._images if self._count is None else counted):
            if isinstance(thing, (str, os.PathLike)):
                path = os.fspath(thing)
                yield Shot(None, _name_of(path), partial(read_any, path), path=path)
            else:
                image = getattr(thing, "image", thing)
                yield Shot(None, str(index), partial(pixels_of, image))


def _is_counted(images: Any) -> bool:
    return hasattr(images, "__len__") and hasattr(images, "__getitem__")


def frames_of(images: Any) -> Frames:
    """The frames of whatever ``Map.from_images`` takes, and of a generator of images or frames."""
    if isinstance(images, Images) and images.paths is not None:
        images = images.paths
    if isinstance(images, (str, os.PathLike)):
        found = ImageFiles(image_files(images, also=list(endings()))[0])
        images = found if found.paths is None else found.paths
    if isinstance(images, np.ndarray) and (
        images.ndim not in (3, 4) or (images.ndim == 3 and images.shape[2] in CHANNELS)
    ):
        expected = "(n, H, W) or (n, H, W, 3), one image a place"
        raise mismatch("images", expected, f"the shape {images.shape}")
    if not _is_counted(images) and not hasattr(images, "__iter__"):
        expected = "a folder, a pattern, or images or paths one after the other"
        raise mismatch("images", expected, type(images).__name__)
    frames = images if isinstance(images, Frames) else _GivenFrames(images)
    if frames.count == 0:
        raise mismatch("images", "at least one", "none")
    return frames


def open_images(place: Path) -> Images:
    """A folder or pattern of image files, or a ``.npy`` of images, in route order."""
    frames = ImageFrames(place)
    if frames.ready is not None:
        got = f"{frames.ready.dtype} {frames.ready.shape}"
        raise mismatch(place, "uint8 images (n, H, W) or (n, H, W, 3)", got)
    return frames.images


def _shots_of_images(images: Any) -> Generator[Shot, None, None]:
    names, paths = getattr(images, "names", None), getattr(images, "paths", None)
    for index in range(len(images)):
        name = names[index] if names else str(index)
        path = paths[index] if paths else None
        yield Shot(None, name, partial(images.__getitem__, index), path=path)


def _load_array(place: str, key: str | None) -> npt.NDArray[Any]:
    if Path(place).suffix.lower() != ".npy":
        return load(place, key)
    check_no_key(place, key)
    array = read_npy(place, "the array", mapped=True)
    images = array.ndim == 3 or (array.ndim == 4 and array.shape[3] in CHANNELS)
    if array.ndim == 2:
        return load(place)
    if not (images and array.dtype.newbyteorder("=") in (np.uint8, np.uint16)):
        expected = "descriptors (n, dim), or uint8 or uint16 images (n, H, W) or (n, H, W, 3)"
        raise mismatch(place, expected, f"{array.dtype} {array.shape}")
    return array
