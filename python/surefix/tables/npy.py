"""The array of a ``.npy``, or one of a ``.npz``."""

import math
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix.errors import SurefixError, SurefixValueError, mismatch, refusal
from surefix.tables.objects import header_of, read_objects
from surefix.tables.regular import check_regular, check_room, within_memory

# DEFLATE makes a byte into 1032 at most.
MOST = 1032
METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


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
    holds. ``objects``: one of lists too (``read_objects``). Memory is taken for numbers that the
    file has, not for those that its header claims.
    """
    file = Path(path)
    if keys and file.suffix.lower() == ".npz":
        names = names_in(file, what)
        key = next((key for key in keys if key in names), names[0] if len(names) == 1 else None)
        if key is None:
            raise mismatch(path, f"one array, or one of {', '.join(keys)}", _listed(names))
        return read_member(file, key, what, objects=objects)
    length = check_regular(file, f"cannot read {what}")
    try:
        with file.open("rb") as opened, within_memory(file):
            if not opened.read(2).startswith(b"PK"):
                opened.seek(0)
                return _array(opened, length, file, mapped=mapped, objects=objects)
    except OSError as error:
        if isinstance(error, SurefixError):
            raise
        raise refusal(path, f"cannot read {what}", error) from None
    except (ValueError, EOFError) as error:
        if isinstance(error, SurefixError):
            raise
        raise SurefixValueError(f"{path}: not a .npy array, or a truncated one ({error})") from None
    raise mismatch(path, "one array (.npy)", "an archive of several (.npz)")


def names_in(path: Path, what: str) -> list[str]:
    """The names of the arrays of a ``.npz``."""
    with _archive(path, what) as archive:
        return [name.removesuffix(".npy") for name in archive.namelist()]


def read_member(path: Path, key: str, what: str, *, objects: bool = False) -> npt.NDArray[Any]:
    """The array ``key`` of a ``.npz``, which has it."""
    with _archive(path, what) as archive:
        try:
            about = archive.getinfo(f"{key}.npy")
            stored = min(about.compress_size, path.stat().st_size)
            if about.compress_type not in METHODS:
                raise mismatch(path, "arrays stored or deflated, as NumPy does", "another packing")
            if about.file_size > MOST * stored + MOST:
                got = f"{stored} bytes packed, which claim to be {about.file_size}"
                raise mismatch(path, "a whole archive (.npz)", got)
            with archive.open(about) as opened:
                return _array(opened, about.file_size, path, objects=objects)
        except (ValueError, EOFError, KeyError, RuntimeError, zipfile.BadZipFile) as error:
            if isinstance(error, SurefixError):
                raise
            raise SurefixValueError(f"{path}, {key}: not an array of numbers ({error})") from None


@contextmanager
def _archive(path: Path, what: str) -> Iterator[zipfile.ZipFile]:
    check_regular(path, f"cannot read {what}")
    try:
        with within_memory(path), zipfile.ZipFile(path) as archive:
            yield archive
    except OSError as error:
        if isinstance(error, SurefixError):
            raise
        raise refusal(path, f"cannot read {what}", error) from None
    except (zipfile.BadZipFile, NotImplementedError, UnicodeDecodeError) as error:
        raise SurefixValueError(f"{path}: not a .npz archive, or a damaged one ({error})") from None


def _array(
    opened: Any, length: int, path: Path, *, mapped: bool = False, objects: bool = False
) -> npt.NDArray[Any]:
    """The array at the start of an open file of ``length`` bytes."""
    header = header_of(opened)
    if header.dtype.hasobject:
        if not objects or mapped:
            raise mismatch(path, "an array of numbers", "one of Python objects")
        opened.seek(0)
        return read_objects(opened, path)
    size = math.prod(header.shape) * header.dtype.itemsize
    if size > length - header.end:
        claim = f"its shape {header.shape} takes {size} bytes, and it has {length - header.end}"
        raise SurefixValueError(f"{path}: not a .npy array, or a truncated one ({claim})")
    if mapped:
        array: npt.NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
        return array
    check_room(size, path)
    opened.seek(0)
    return np.asarray(np.lib.format.read_array(opened, allow_pickle=False))


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) or "none"
