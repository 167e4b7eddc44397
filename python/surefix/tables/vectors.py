"""Ready descriptors in NumPy, safetensors, HDF5 and faiss files."""

import math
import os
import re
import struct
from collections import Counter
from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from surefix._extra import require
from surefix.errors import SurefixError, SurefixValueError, mismatch, refusal
from surefix.tables.npy import names_in, read_member, read_npy
from surefix.tables.regular import check_regular, check_room, within_memory

Rows = npt.NDArray[Any]
NUMBERS = ("float32", "float16", "int8", "uint8")
# The number of names that an error lists.
LISTED = 12
# Of HDF5, the most bytes that a packed one may be: DEFLATE makes 1032 of one.
PACKED = 2000
# The first bytes of faiss's flat indices, and of some others.
FLAT = (b"IxFI", b"IxF2", b"IxFl")
OTHER = {
    b"IxMp": "IndexIDMap",
    b"IxM2": "IndexIDMap2",
    b"IHNf": "IndexHNSWFlat",
    b"IwFl": "IndexIVFFlat",
    b"IwPQ": "IndexIVFPQ",
    b"IxPT": "IndexPreTransform",
}
# How far from 1 the length of a normalised float32 vector may be.
UNIT = 1e-3


def load(path: str | PathLike[str], key: str | None = None) -> Rows:
    """The vectors of a file, as ``Map.from_descriptors`` takes them.

    ==================  ========================================================================
    ``.npy``            one array, memory-mapped
    ``.npz``            ``key`` is the array's name
    ``.safetensors``    ``key`` is the tensor's name; ``pip install safetensors``
    ``.h5``, ``.hdf5``  ``key`` is the data set's path; or its name in the groups of the images, as
                        hloc writes them, ``frame9`` before ``frame10``; if the images lie in
                        several folders, with the folder before: ``db/global_descriptor``, or
                        ``*/global_descriptor`` for all of them; ``pip install h5py``
    ``.faiss``,         a flat index; ``pip install faiss-cpu``
    ``.index``
    ==================  ========================================================================

    The packages come with ``pip install "surefix[files]"``, faiss with ``"surefix[faiss]"``.

    Parameters
    ----------
    path : str or path
    key : str, optional
        Which array, if the file holds several.

    Returns
    -------
    array, shape (n, dim), float32, float16, int8 or uint8
        float64 is made float32.

    Raises
    ------
    SurefixFileError
        If the file cannot be read.
    SurefixValueError
        If it is not a file of its kind, has no such array (the error lists those it has), or the
        array holds no vectors.
    SurefixError
        If the package for it is missing.

    Examples
    --------
    >>> from surefix.descriptors import load
    >>> rows = load("netvlad.h5", key="global_descriptor")   # doctest: +SKIP
    >>> route = surefix.Map.from_descriptors(rows)   # doctest: +SKIP
    """
    file = Path(path)
    reader = _READERS.get(file.suffix.lower())
    if reader is None:
        raise SurefixValueError(f"{file}: expected a file that ends in {', '.join(ENDINGS)}")
    check_regular(file, "cannot read the descriptors")
    try:
        with file.open("rb"):
            pass
    except OSError as error:
        raise refusal(file, "cannot read the descriptors", error) from None
    with within_memory(file):
        return _checked(file, key, reader(file, key))


def metric_of(path: str | PathLike[str]) -> Literal["cosine", "euclidean"] | None:
    """The metric that a file is made for, if it says so: a faiss index does.

    An index of inner products is one of cosines if its vectors are of unit length, and refused
    otherwise.

    Raises
    ------
    SurefixError
        As for ``load``.
    """
    file = Path(path)
    return _read_index(file)[1] if _READERS.get(file.suffix.lower()) is _faiss else None


def _none(path: Path, kind: str, reason: object) -> SurefixValueError:
    return SurefixValueError(f"{path}: not {kind}, or a truncated one ({reason})")


def _npy(path: Path, key: str | None) -> Rows:
    check_no_key(path, key)
    return read_npy(path, "the descriptors", mapped=True)


def _npz(path: Path, key: str | None) -> Rows:
    names = names_in(path, "the descriptors")
    return read_member(path, _one_of(path, key, names), "the descriptors")


def _safetensors(path: Path, key: str | None) -> Rows:
    library = require("safetensors", "a .safetensors file", "safetensors", "surefix[files]")
    try:
        with library.safe_open(path, framework="np") as tensors:
            name = _one_of(path, key, list(tensors.keys()))
            # Its type may be one that NumPy has not: at most 8 bytes a number.
            check_room(8 * math.prod(tensors.get_slice(name).get_shape()), path)
            array: Rows = tensors.get_tensor(name)
    except library.SafetensorError as error:
        raise _none(path, "a .safetensors file", error) from None
    except (TypeError, AttributeError) as error:
        # NumPy has no bfloat16, for one.
        raise mismatch(path, ", ".join(NUMBERS), f"another type ({error})") from None
    return array


def _hdf5(path: Path, key: str | None) -> Rows:
    library = require("h5py", "an HDF5 file", "h5py", "surefix[files]")
    try:
        with library.File(path, "r") as file:
            found: dict[str, Any] = {}

            def visit(name: str, thing: Any) -> None:
                if isinstance(thing, library.Dataset):
                    found[name] = thing

            file.visititems(visit)
            return _data_set(path, key, found)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        if isinstance(error, SurefixError):
            raise
        raise _none(path, "an HDF5 file", error) from None


def _data_set(path: Path, key: str | None, found: dict[str, Any]) -> Rows:
    """The data set ``key``; or those of this name in all groups, or in those of one folder."""
    key = None if key is None else key.strip("/")
    if key is None and len(found) == 1:
        (key,) = found
    if key in found:
        return _numbers(path, found[key])
    folder, _, name = (key or "").rpartition("/")
    groups = {full: full.rpartition("/")[0] for full in found if full.rpartition("/")[2] == name}
    of_images = [full for full, group in groups.items() if group]
    folders = Counter(full.partition("/")[0] for full in of_images if full.count("/") > 1)
    if folder not in ("", "*"):
        of_images = [full for full in of_images if full.startswith(folder + "/")]
    elif not folder and len(folders) > 1:
        listed = ", ".join(f"{folder} ({count})" for folder, count in sorted(folders.items()))
        expected = f"a key with the folder of the images before: {sorted(folders)[0]}/{name}, or "
        raise mismatch(path, f"{expected}*/{name} for all of them", f"{name} in {listed}")
    if name == "" or not of_images:
        # If there are many groups, the names of the data sets in them say more.
        named = {full.rpartition("/")[2] for full in found} if len(found) > LISTED else found
        short = ", ".join(sorted(named)[:LISTED]) + (", ..." if len(named) > LISTED else "")
        got = "no key" if key is None else f"the key {key!r}"
        raise mismatch(path, f"one of the data sets {short or '(there are none)'}", got)
    of_images.sort(key=_as_counted)
    first = found[of_images[0]]
    check_room(2 * first.size * first.dtype.itemsize * len(of_images), path)
    rows = [_numbers(path, found[full]) for full in of_images]
    for full, row in zip(of_images, rows, strict=True):
        if row.ndim != 1 or row.shape != rows[0].shape:
            expected = f"a vector of {rows[0].size} numbers as in the first group"
            raise mismatch(f"{path}, {full}", expected, f"the shape {row.shape}")
    return np.stack(rows)


def _numbers(path: Path, data: Any) -> Rows:
    """The numbers of a data set, which the file has: a shape alone is no reason to take memory."""
    where, size = f"{path}, {data.name}", data.size * data.dtype.itemsize
    if data.external:
        raise mismatch(where, "numbers in this file", "a data set that lies in another file")
    stored = data.id.get_storage_size()
    if not data.is_virtual and size > PACKED * stored + PACKED:
        raise mismatch(where, f"{size} bytes of numbers, of the shape {data.shape}", stored)
    check_room(size, where)
    return np.asarray(data)


def _as_counted(name: str) -> list[tuple[int, int, str]]:
    """The order that ``find_images`` puts files in: numbers by their value."""
    pieces = re.findall(r"\d+|\D+", name)
    return [(0, int(piece), piece) if piece.isdecimal() else (1, 0, piece) for piece in pieces]


def _faiss(path: Path, key: str | None) -> Rows:
    check_no_key(path, key)
    return _read_index(path)[0]


def _read_index(path: Path) -> tuple[Rows, Literal["cosine", "euclidean"]]:
    """The vectors in a flat faiss index, and its metric."""
    library = require("faiss", "a faiss index", "faiss", "surefix[faiss]")
    _check_flat(path)
    try:
        with within_memory(path):
            index: Any = library.read_index(str(path))
    except RuntimeError as error:
        raise _none(path, "a faiss index", str(error).strip().split("\n")[-1]) from None
    empty: Rows = np.empty((0, index.d), np.float32)
    rows = index.reconstruct_n(0, index.ntotal) if index.ntotal else empty
    if index.metric_type == library.METRIC_L2:
        return rows, "euclidean"
    if index.metric_type != library.METRIC_INNER_PRODUCT:
        raise mismatch(path, "an index of L2 or of inner products", f"metric {index.metric_type}")
    lengths = np.linalg.norm(rows.astype(np.float64), axis=1)
    if len(rows) and np.abs(lengths - 1).max() > UNIT:
        expected = "vectors of unit length in an index of inner products, which are cosines then"
        got = f"lengths from {lengths.min():.4g} to {lengths.max():.4g}"
        raise mismatch(path, expected, got)
    return rows, "cosine"


def _check_flat(path: Path) -> None:
    """Refuses another index than a flat one, and one that claims more vectors than the file has."""
    length = check_regular(path, "cannot read the descriptors")
    with path.open("rb") as file:
        start = file.read(16)
    mark = start[:4]
    if len(start) < 16 or not re.fullmatch(rb"I[\x21-\x7e]{3}", mark):
        raise _none(path, "a faiss index", "it does not begin as one does")
    if mark not in FLAT:
        name = OTHER.get(mark, repr(mark.decode()))
        holds = "which holds the vectors themselves in their order"
        raise mismatch(path, f"a flat index (IndexFlatL2, IndexFlatIP), {holds}", name)
    dim, count = struct.unpack("<iq", start[4:])
    if dim < 0 or count < 0 or 4 * dim * count > length:
        expected = f"{count} vectors of {dim} numbers, as a faiss index says"
        raise mismatch(path, expected, f"{length} bytes")
    check_room(2 * length, path)


_READERS: dict[str, Callable[[Path, str | None], Rows]] = {
    ".npy": _npy,
    ".npz": _npz,
    ".safetensors": _safetensors,
    ".h5": _hdf5,
    ".hdf5": _hdf5,
    ".faiss": _faiss,
    ".index": _faiss,
}
ENDINGS = tuple(_READERS)


def check_no_key(path: str | Path, key: str | None) -> None:
    """Refuses a key for a file with one array."""
    if key is not None:
        raise mismatch(path, "no key, as such a file holds one array", repr(key))


def _one_of(path: Path, key: str | None, keys: Sequence[str]) -> str:
    listed = ", ".join(sorted(keys)) or "none"
    if key is None and len(keys) == 1:
        return keys[0]
    if key is None:
        raise SurefixValueError(f"{path}: expected a key, as it holds {len(keys)} arrays: {listed}")
    if key not in keys:
        raise mismatch(path, f"one of the arrays {listed}", f"the key {key!r}")
    return key


def _checked(path: Path, key: str | None, array: Rows) -> Rows:
    where = os.fspath(path) if key is None else f"{path}, {key}"
    if array.dtype.kind not in "fiu" or array.dtype.name not in (*NUMBERS, "float64"):
        raise mismatch(where, f"descriptors of {', '.join(NUMBERS)}", array.dtype)
    if array.ndim != 2 or 0 in array.shape:
        raise mismatch(where, "descriptors (n, dim)", f"the shape {array.shape}")
    # In the byte order of this machine; and float64, which no map keeps, as float32.
    name = "float32" if array.dtype.name == "float64" else array.dtype.name
    return array if array.dtype == np.dtype(name) else array.astype(name)
