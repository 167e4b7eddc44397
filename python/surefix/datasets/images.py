"""The images of a traverse, each read when it is asked for."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from operator import index as as_index
from pathlib import Path
from typing import Self, SupportsIndex, overload

import numpy as np
import numpy.typing as npt

from surefix._core import find_images, read_image
from surefix.datasets.bayer import Method, Pattern, demosaic
from surefix.errors import SurefixFileError, SurefixValueError

__all__ = ["BayerFiles", "ImageArray", "ImageFiles", "Images", "open_images"]

UInt8 = npt.NDArray[np.uint8]


class Images(Sequence[UInt8], ABC):
    """A traverse's images in route order, loaded lazily: ``images[i]`` is uint8, (H, W) grey or (H,
    W, 3) RGB.

    ``Map.from_images`` and ``match`` take one as it is, and then hold all its images at once. Where
    ``paths`` is not None, give them that instead: plain image files are read and described in
    parallel, a few at a time.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.datasets import ImageArray
    >>> route = ImageArray(np.zeros((3, 4, 6), np.uint8))
    >>> len(route), route[-1].shape, route.names, len(route[1:])
    (3, (4, 6), ['0', '1', '2'], 2)
    """

    def __init__(self, names: Iterable[str]) -> None:
        self._names = list(names)

    @property
    def names(self) -> list[str]:
        """A name for each image: its file's name, or its number."""
        return list(self._names)

    @property
    def paths(self) -> list[str] | None:
        """The image files, where each is a plain image; None where the images need this class to be
        read.
        """
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
        return self._load(range(len(self))[as_index(key)])

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self)} images)"

    @abstractmethod
    def _load(self, index: int) -> UInt8: ...

    @abstractmethod
    def _take(self, indices: Sequence[int]) -> Self: ...


class ImageFiles(Images):
    """Plain image files: png, jpeg, bmp, tiff, webp or pnm."""

    def __init__(self, paths: Iterable[str | Path]) -> None:
        self._paths = [str(path) for path in paths]
        super().__init__(Path(path).name for path in self._paths)

    @property
    def paths(self) -> list[str]:
        return list(self._paths)

    def _load(self, index: int) -> UInt8:
        return read_image(self._paths[index])

    def _take(self, indices: Sequence[int]) -> Self:
        return type(self)(self._paths[i] for i in indices)


class BayerFiles(Images):
    """Grey image files that hold a Bayer mosaic; ``images[i]`` is the colour image. ``paths`` is
    None on purpose.
    """

    def __init__(self, files: Iterable[str | Path], pattern: Pattern, method: Method) -> None:
        self.files = [str(path) for path in files]
        self.pattern: Pattern = pattern
        self.method: Method = method
        super().__init__(Path(path).name for path in self.files)

    def _load(self, index: int) -> UInt8:
        mosaic = read_image(self.files[index])
        try:
            return demosaic(mosaic, self.pattern, self.method)
        except SurefixValueError as error:
            raise SurefixValueError(f"{self.files[index]}: {error}") from None

    def _take(self, indices: Sequence[int]) -> Self:
        return type(self)([self.files[i] for i in indices], self.pattern, self.method)


class ImageArray(Images):
    """Images that lie in one array, (n, H, W) or (n, H, W, 3) uint8, in memory or memory-mapped."""

    def __init__(self, array: UInt8, names: Iterable[str] | None = None) -> None:
        self.array = array
        super().__init__(map(str, range(len(array))) if names is None else names)

    def _load(self, index: int) -> UInt8:
        return np.array(self.array[index])

    def _take(self, indices: Sequence[int]) -> Self:
        return type(self)(self.array[list(indices)], [self._names[i] for i in indices])


def open_images(place: Path) -> Images:
    """A folder or pattern of image files, or a ``.npy`` of images, in route order.

    Raises
    ------
    SurefixFileError
        Where there is no such folder or file.
    SurefixValueError
        Where it holds no images.
    """
    if place.suffix != ".npy":
        return ImageFiles(find_images(place))
    try:
        array: UInt8 = np.load(place, mmap_mode="r", allow_pickle=False)
    except OSError as error:
        raise SurefixFileError(
            f"{place}: cannot read the images: {error.strerror or error}"
        ) from None
    except (ValueError, EOFError) as error:
        raise SurefixValueError(
            f"{place}: not a .npy array, or a truncated one ({error})"
        ) from None
    if array.dtype != np.uint8 or not (
        array.ndim == 3 or (array.ndim == 4 and array.shape[3] == 3)
    ):
        got = f"{array.dtype} {array.shape}"
        raise SurefixValueError(
            f"{place}: expected uint8 images (n, H, W) or (n, H, W, 3), got {got}"
        )
    return ImageArray(array)
