"""Frames from an array in a file."""

from collections.abc import Generator
from functools import partial
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix.descriptors.ready import load
from surefix.errors import SurefixFileError, SurefixValueError
from surefix.streams.stream import Shot, Stream

__all__ = ["ArrayStream", "load_frames"]


class ArrayStream(Stream):
    """The rows of a ``.npy``: uint8 images, (n, H, W) or (n, H, W, 3), or ready descriptors (n,
    dim). No times.

    Ready descriptors also from the other files that ``surefix.descriptors.load`` reads.

    Raises
    ------
    SurefixFileError
        Where the file cannot be read.
    SurefixValueError
        Where it holds something else.
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        self.path = fspath(path)
        self.array = load_frames(self.path)

    @property
    def count(self) -> int:
        """How many rows."""
        return len(self.array)

    @property
    def files(self) -> list[str]:
        """The one that was named."""
        return [self.path]

    def shots(self) -> Generator[Shot, None, None]:
        """Each row, by its number."""
        for index, row in enumerate(self.array):
            yield Shot(None, str(index), partial(np.asarray, row))


def load_frames(place: str, key: str | None = None) -> npt.NDArray[Any]:
    """The array of a ``.npy`` of images or of descriptors, or that of another file of descriptors.

    Parameters
    ----------
    place : str
    key : str, optional
        As for ``surefix.descriptors.load``.

    Raises
    ------
    SurefixFileError
        Where the file cannot be read.
    SurefixValueError
        Where it holds something else.
    """
    if Path(place).suffix.lower() != ".npy":
        return load(place, key)
    if key is not None:
        raise SurefixValueError(
            f"{place}: expected no key, as such a file holds one array, got {key!r}"
        )
    try:
        array: npt.NDArray[Any] = np.load(place, allow_pickle=False)
    except OSError as error:
        raise SurefixFileError(
            f"{place}: cannot read the array: {error.strerror or error}"
        ) from None
    except (ValueError, EOFError) as error:
        raise SurefixValueError(
            f"{place}: not a .npy array, or a truncated one ({error})"
        ) from None
    if not isinstance(array, np.ndarray):
        raise SurefixValueError(
            f"{place}: expected one array (.npy), got an archive of several (.npz)"
        )
    image = array.dtype == np.uint8 and (
        array.ndim == 3 or (array.ndim == 4 and array.shape[3] == 3)
    )
    if array.ndim != 2 and not image:
        raise SurefixValueError(
            f"{place}: expected descriptors (n, dim), or uint8 images (n, H, W) or (n, H, W, 3), "
            f"got {array.dtype} {array.shape}"
        )
    return array
