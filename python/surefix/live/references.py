"""The pictures of a map's places, where they can still be found."""

from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from surefix import Map, SurefixError, SurefixValueError, read_image

__all__ = ["References"]


class References:
    """The image of a place, by the name that the map has for it.

    Parameters ---------- map : Map Its ``names`` are file names. folder : path, optional Where
    those files are. Without it, names are looked for as they are: a path, or a file in the working
    folder.

    Raises
    ------
    SurefixValueError
        Where a folder is given that is none, or that has none of the map's images.
    """

    # A robot that stands or moves slowly asks for the same few places again and again.
    KEPT = 32

    def __init__(self, map: Map, folder: str | Path | None = None) -> None:
        self.names = map.names
        self.folder = Path() if folder is None else Path(folder)
        self.image = lru_cache(maxsize=self.KEPT)(self._image)
        if folder is not None:
            if not self.folder.is_dir():
                raise SurefixValueError(
                    f"references: expected the folder of the map's images, got {self.folder}"
                )
            if not self:
                first = f"its first is {self.names[0]}" if self.names else "it has no names"
                raise SurefixValueError(
                    f"references: expected images of the map in {self.folder}, got none: {first}"
                )

    def __bool__(self) -> bool:
        """Whether there are any, going by the first and the last place."""
        return self.names is not None and any(
            (self.folder / self.names[place]).is_file() for place in (0, -1)
        )

    def _image(self, place: int) -> NDArray[np.uint8] | None:
        """The image of a place; None where there is none, or it cannot be read."""
        if not self.names:
            return None
        file = self.folder / self.names[place]
        try:
            return read_image(file) if file.is_file() else None
        except SurefixError:
            # A picture beside the answer is no reason to stop a robot.
            return None
