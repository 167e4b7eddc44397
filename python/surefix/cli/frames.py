"""What the command line takes as frames: a folder, a pattern, or a ``.npy`` of images or of descriptors."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix import SurefixFileError, SurefixValueError, find_images, read_image

__all__ = ["Frames"]


class Frames:
    """Frames in route order, each with a name, loaded when they are needed.

    Raises
    ------
    SurefixError
        Where there are none, or the file is not an array of images or of descriptors.
    """

    def __init__(self, place: str) -> None:
        self.place = place
        self.paths: list[str] | None = None
        self.array: npt.NDArray[Any] | None = None
        if Path(place).suffix == ".npy":
            self.array = _load(place)
        else:
            self.paths = find_images(place)

    def __len__(self) -> int:
        """How many frames."""
        return len(self.paths) if self.paths is not None else len(self._rows)

    def __iter__(self) -> Iterator[tuple[str, npt.NDArray[Any]]]:
        """Each frame's name, and the frame: a uint8 image, or a descriptor."""
        if self.paths is not None:
            for path in self.paths:
                yield Path(path).name, read_image(path)
        else:
            for index, row in enumerate(self._rows):
                yield str(index), row

    def holds(self, file: Path) -> bool:
        """Whether ``file`` is one of those that the frames are read from."""
        sources = [self.place] if self.paths is None else self.paths
        return file.exists() and any(Path(source).exists() and file.samefile(source) for source in sources)

    @property
    def _rows(self) -> npt.NDArray[Any]:
        assert self.array is not None
        return self.array

    @property
    def descriptors(self) -> npt.NDArray[Any] | None:
        """All frames at once where they are descriptors, shape (n, dim); else None."""
        return self.array if self.array is not None and self.array.ndim == 2 else None

    @property
    def images(self) -> list[str] | npt.NDArray[Any]:
        """What ``Map.from_images`` takes, where the frames are images."""
        return self.paths if self.paths is not None else self._rows


def _load(place: str) -> npt.NDArray[Any]:
    try:
        array: npt.NDArray[Any] = np.load(place, allow_pickle=False)
    except OSError as error:
        raise SurefixFileError(f"{place}: cannot read the array: {error.strerror or error}") from None
    except (ValueError, EOFError) as error:
        raise SurefixValueError(f"{place}: not a .npy array, or a truncated one ({error})") from None
    if not isinstance(array, np.ndarray):
        raise SurefixValueError(f"{place}: expected one array (.npy), got an archive of several (.npz)")
    image = array.dtype == np.uint8 and (array.ndim == 3 or (array.ndim == 4 and array.shape[3] == 3))
    if array.ndim != 2 and not image:
        raise SurefixValueError(
            f"{place}: expected descriptors (n, dim), or uint8 images (n, H, W) or (n, H, W, 3), "
            f"got {array.dtype} {array.shape}"
        )
    return array
