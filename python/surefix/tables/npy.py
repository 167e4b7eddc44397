"""The array of a ``.npy``, or one of a ``.npz``."""

import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix.errors import SurefixError, SurefixValueError, mismatch, refusal
from surefix.tables.objects import read_objects


def read_npy(
    path: str | Path,
    what: str,
    *,
    mapped: bool = False,
    keys: Sequence[str] = (),
    objects: bool = False,
) -> npt.NDArray[Any]:
    """The array; ``what`` names it in an error: "the truth". ``mapped``: memory-mapped.

    Of a ``.npz``, if ``keys`` are given: the first of these that it has, or the one array that it
    holds. ``objects``: one of lists too (``read_objects``).
    """
    file = Path(path)
    if keys and file.suffix.lower() == ".npz":
        return _of_archive(file, what, keys, objects)
    try:
        if objects and not mapped:
            with file.open("rb") as opened:
                return _one(opened, file)
        mode: Any = "r" if mapped else None
        array: npt.NDArray[Any] = np.load(path, mmap_mode=mode, allow_pickle=False)
    except OSError as error:
        raise refusal(path, f"cannot read {what}", error) from None
    except (ValueError, EOFError) as error:
        if isinstance(error, SurefixError):
            raise
        if "Object arrays" in str(error):
            raise mismatch(path, "an array of numbers", "one of Python objects") from None
        raise SurefixValueError(f"{path}: not a .npy array, or a truncated one ({error})") from None
    if not isinstance(array, np.ndarray):
        array.close()
        raise mismatch(path, "one array (.npy)", "an archive of several (.npz)")
    return array


def names_in(path: Path, what: str) -> list[str]:
    """The names of the arrays of a ``.npz``."""
    try:
        with zipfile.ZipFile(path) as archive:
            return [name.removesuffix(".npy") for name in archive.namelist()]
    except OSError as error:
        raise refusal(path, f"cannot read {what}", error) from None
    except zipfile.BadZipFile as error:
        raise SurefixValueError(f"{path}: not a .npz archive, or a damaged one ({error})") from None


def _one(opened: Any, path: Path) -> npt.NDArray[Any]:
    """The array at the start of an open file, which may be of lists."""
    start = opened.tell()
    try:
        array = np.lib.format.read_array(opened, allow_pickle=False)
    except ValueError as error:
        if "Object arrays" not in str(error):
            raise
        opened.seek(start)
        return read_objects(opened, path)
    return np.asarray(array)


def _of_archive(path: Path, what: str, keys: Sequence[str], objects: bool) -> npt.NDArray[Any]:
    names = names_in(path, what)
    key = next((key for key in keys if key in names), names[0] if len(names) == 1 else None)
    if key is None:
        raise mismatch(path, f"one array, or one of {', '.join(keys)}", ", ".join(names) or "none")
    try:
        with zipfile.ZipFile(path) as archive, archive.open(f"{key}.npy") as opened:
            if objects:
                return _one(opened, path)
            return np.asarray(np.lib.format.read_array(opened, allow_pickle=False))
    except (ValueError, EOFError, KeyError, zipfile.BadZipFile) as error:
        if isinstance(error, SurefixError):
            raise
        raise SurefixValueError(f"{path}, {key}: not an array of numbers ({error})") from None
