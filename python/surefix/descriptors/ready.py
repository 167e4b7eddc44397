"""Vectors that somebody has made already: NumPy, safetensors, HDF5 and faiss files."""

import os
import zipfile
from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from surefix._extra import needed
from surefix.descriptors.faiss_index import read_index
from surefix.descriptors.hdf5 import read_hdf5
from surefix.errors import SurefixError, SurefixFileError, SurefixValueError

__all__ = ["ENDINGS", "load", "metric_of"]

Rows = npt.NDArray[Any]
NUMBERS = ("float32", "float16", "int8", "uint8")


def load(path: str | PathLike[str], key: str | None = None) -> Rows:
    """The vectors of a file, as ``Map.from_descriptors`` takes them.

    =============================  =====================================================
    ========================== ``.npy``                       one array, memory-mapped ``.npz``
    ``key`` is the array's name ``.safetensors``               ``key`` is the tensor's name
    ``pip install safetensors`` ``.h5``, ``.hdf5``             ``key`` is the data set's path; or
    its name in the     ``pip install h5py`` groups of the images, as hloc writes them, in the order
    a person would put those in ``.faiss``, ``.index``         a flat index
    ``pip install faiss-cpu`` =============================
    =====================================================  ==========================

    The packages come with ``pip install "surefix[files]"``.

    Parameters
    ----------
    path : str or path
    key : str, optional
        Which array, where the file holds several.

    Returns
    -------
    array, shape (n, dim), float32, float16, int8 or uint8
        float64 is made float32.

    Raises ------ SurefixFileError Where the file cannot be read. SurefixValueError Where it is not
    a file of its kind, has no such array (the error lists what there is), or the array is no
    vectors. SurefixError Where the package for it is missing.

    Examples
    --------
    >>> from surefix.descriptors import load
    >>> surefix.Map.from_descriptors(load("netvlad.h5", key="global_descriptor"))               # doctest: +SKIP
    """
    file = Path(path)
    reader = _READERS.get(file.suffix.lower())
    if reader is None:
        raise SurefixValueError(f"{file}: expected a file that ends in {', '.join(ENDINGS)}")
    try:
        with file.open("rb"):
            pass
    except OSError as error:
        raise SurefixFileError(
            f"{file}: cannot read the descriptors: {error.strerror or error}"
        ) from None
    return _checked(file, key, reader(file, key))


def metric_of(path: str | PathLike[str]) -> Literal["cosine", "euclidean"] | None:
    """How the vectors of a file are meant to be compared, where the file says so: a faiss index
    does.

    An index of inner products is one of cosines where its vectors are of unit length, and is
    refused where not.

    Raises
    ------
    SurefixError
        As for ``load``.
    """
    file = Path(path)
    return read_index(file)[1] if _READERS.get(file.suffix.lower()) is _faiss else None


def _npy(path: Path, key: str | None) -> Rows:
    _no_key(path, key)
    try:
        array: Rows = np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, EOFError, OSError) as error:
        raise SurefixValueError(f"{path}: not a .npy array, or a truncated one ({error})") from None
    if not isinstance(array, np.ndarray):
        array.close()
        raise SurefixValueError(
            f"{path}: expected one array (.npy), got an archive of several (.npz)"
        )
    return array


def _npz(path: Path, key: str | None) -> Rows:
    try:
        # Opened here, as NumPy leaves a file open that is no archive.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            if not isinstance(archive, np.lib.npyio.NpzFile):
                raise SurefixValueError(f"{path}: expected an archive (.npz), got one array (.npy)")
            array: Rows = archive[_one_of(path, key, archive.files)]
    except (ValueError, EOFError, OSError, zipfile.BadZipFile, KeyError) as error:
        if isinstance(error, SurefixError):
            raise
        raise SurefixValueError(
            f"{path}: not a .npz archive, or a truncated one ({error})"
        ) from None
    return array


def _safetensors(path: Path, key: str | None) -> Rows:
    library = needed("safetensors", "a .safetensors file", "safetensors", "surefix[files]")
    try:
        with library.safe_open(path, framework="np") as tensors:
            array: Rows = tensors.get_tensor(_one_of(path, key, list(tensors.keys())))
    except library.SafetensorError as error:
        raise SurefixValueError(
            f"{path}: not a .safetensors file, or a truncated one ({error})"
        ) from None
    except (TypeError, AttributeError) as error:
        # bfloat16, for one, is no number of NumPy's.
        raise SurefixValueError(
            f"{path}: expected {', '.join(NUMBERS)}, got another type ({error})"
        ) from None
    return array


def _hdf5(path: Path, key: str | None) -> Rows:
    return read_hdf5(path, key)


def _faiss(path: Path, key: str | None) -> Rows:
    _no_key(path, key)
    return read_index(path)[0]


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


def _no_key(path: Path, key: str | None) -> None:
    if key is not None:
        raise SurefixValueError(
            f"{path}: expected no key, as such a file holds one array, got {key!r}"
        )


def _one_of(path: Path, key: str | None, keys: Sequence[str]) -> str:
    listed = ", ".join(sorted(keys)) or "none"
    if key is None and len(keys) == 1:
        return keys[0]
    if key is None:
        raise SurefixValueError(f"{path}: expected a key, as it holds {len(keys)} arrays: {listed}")
    if key not in keys:
        raise SurefixValueError(f"{path}: expected one of the arrays {listed}, got the key {key!r}")
    return key


def _checked(path: Path, key: str | None, array: Rows) -> Rows:
    where = os.fspath(path) if key is None else f"{path}, {key}"
    if array.dtype.kind not in "fiu" or array.dtype.name not in (*NUMBERS, "float64"):
        raise SurefixValueError(
            f"{where}: expected descriptors of {', '.join(NUMBERS)}, got {array.dtype}"
        )
    if array.ndim != 2 or 0 in array.shape:
        raise SurefixValueError(
            f"{where}: expected descriptors (n, dim), got the shape {array.shape}"
        )
    return array.astype(np.float32) if array.dtype.name == "float64" else array
