"""What the command line takes as a whole: a folder, a pattern, a ``.npy`` of images, or a file of
descriptors.
"""

from pathlib import Path
from typing import Any

import numpy.typing as npt

from surefix import SurefixValueError, find_images
from surefix.descriptors.ready import ENDINGS
from surefix.streams.arrays import load_frames

__all__ = ["Frames"]


class Frames:
    """Frames in route order, all known at once; see ``surefix.streams`` for those that come one by
    one.

    ``key`` chooses one of several arrays of a file of descriptors; see
    ``surefix.descriptors.load``.

    Raises
    ------
    SurefixError
        Where there are none, or the file is not an array of images or of descriptors.
    """

    def __init__(self, place: str, key: str | None = None) -> None:
        self.place = place
        self.paths: list[str] | None = None
        self.array: npt.NDArray[Any] | None = None
        if Path(place).suffix.lower() in ENDINGS:
            self.array = load_frames(place, key)
        elif key is not None:
            raise SurefixValueError(f"--key: expected a file of descriptors, got {place}")
        else:
            self.paths = find_images(place)

    def __len__(self) -> int:
        """How many frames."""
        return len(self.paths) if self.paths is not None else len(self._rows)

    def holds(self, file: Path) -> bool:
        """Whether ``file`` is one of those that the frames are read from."""
        sources = [self.place] if self.paths is None else self.paths
        return file.exists() and any(
            Path(source).exists() and file.samefile(source) for source in sources
        )

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
