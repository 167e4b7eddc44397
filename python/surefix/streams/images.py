"""Frames from image files: a folder, a pattern or a list."""

from collections.abc import Generator, Iterable
from functools import partial
from os import PathLike, fspath
from pathlib import Path

from surefix._core import find_images, read_image
from surefix.streams.stream import Shot, Stream

__all__ = ["ImageStream"]


class ImageStream(Stream):
    """The images of a folder or a pattern, ``frame9`` before ``frame10``; or of a list, in its
    order. No times.

    Parameters
    ----------
    place : str or path, or iterable of them
        A folder, a pattern like ``route/*.png``, or a list of files.

    Raises
    ------
    SurefixFileError
        Where there is no such folder, or, when its turn comes, no such file.
    SurefixValueError
        Where there are no images, or, when its turn comes, one cannot be decoded.
    """

    def __init__(self, place: str | PathLike[str] | Iterable[str | PathLike[str]]) -> None:
        one = isinstance(place, (str, PathLike))
        self.paths = find_images(place) if one else [fspath(path) for path in place]  # type: ignore[union-attr, arg-type]

    @property
    def count(self) -> int:
        """How many images."""
        return len(self.paths)

    @property
    def files(self) -> list[str]:
        """The images, in their order."""
        return list(self.paths)

    def shots(self) -> Generator[Shot, None, None]:
        """Each image, by its file's name."""
        for path in self.paths:
            yield Shot(None, Path(path).name, partial(read_image, path))
