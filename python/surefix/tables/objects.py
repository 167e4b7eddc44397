"""Arrays of Python lists in a ``.npy``, read without running what a pickle may hold."""

import io
import pickle
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt

from surefix.errors import SurefixValueError, mismatch

# The longest header of a .npy, in bytes: NumPy takes no longer ones.
LONGEST = 1 << 16
HOLDS = "an array of numbers, or of lists of numbers"


class Header(NamedTuple):
    """What a ``.npy`` says of its numbers, which begin at the byte ``end``."""

    shape: tuple[int, ...]
    fortran: bool
    dtype: Any
    end: int


def header_of(file: BinaryIO) -> Header:
    """The header at the start of a ``.npy``.

    Raises
    ------
    ValueError, EOFError
        If there is none.
    """
    version = np.lib.format.read_magic(file)
    read: Any = np.lib.format
    header = read.read_array_header_1_0 if version == (1, 0) else read.read_array_header_2_0
    start = file.tell()
    length = int.from_bytes(file.read(2 if version == (1, 0) else 4), "little")
    if length > LONGEST:
        raise ValueError(f"a header of {length} bytes")
    file.seek(start)
    try:
        shape, fortran, dtype = header(file)
    except EOFError:
        raise
    except Exception as error:  # It depends on the damaged bytes: those of Python's own parser.
        raise ValueError(str(error)) from None
    if any(side < 0 for side in shape):
        raise ValueError(f"the shape {shape}")
    return Header(shape, fortran, dtype, file.tell())


def read_objects(file: BinaryIO, path: Path) -> npt.NDArray[Any]:
    """The object array of an open ``.npy``: its items are numbers, lists, tuples and arrays.

    A pickle names the functions that make its objects. Only those of NumPy's arrays and numbers are
    known here, so that a file cannot run anything.

    Raises
    ------
    SurefixValueError
        For any other object, and a file that is damaged.
    """
    try:
        shape = header_of(file).shape
        array = _Restricted(io.BytesIO(file.read())).load()
    except SurefixValueError as error:
        raise mismatch(path, HOLDS, error) from None
    # Whatever a damaged pickle raises.
    except Exception as error:
        raise SurefixValueError(f"{path}: not a .npy array, or a damaged one ({error})") from None
    if not isinstance(array, np.ndarray) or array.dtype != object or array.shape != shape:
        raise mismatch(path, HOLDS, f"a pickled {type(array).__name__}")
    return array


class _Restricted(pickle.Unpickler):
    """Knows no name but those of NumPy's arrays and numbers."""

    def find_class(self, module: str, name: str) -> Any:
        """The maker of this name."""
        known = _MAKERS.get(name)
        if known is None or module not in known[0]:
            raise SurefixValueError(f"a pickled {module}.{name}, which is not read")
        return known[1]


def _array(kind: Any, shape: Any, dtype: Any) -> npt.NDArray[Any]:
    """Empty: NumPy's own then fills it."""
    if kind is not np.ndarray:
        raise SurefixValueError(f"a pickled {kind}, which is not read")
    return np.ndarray.__new__(np.ndarray, shape, dtype)


def _scalar(dtype: Any, content: Any = b"") -> Any:
    if not isinstance(dtype, np.dtype) or dtype.kind not in "biuf":
        raise SurefixValueError(f"a pickled {dtype}, which is not read")
    content = content.encode("latin-1") if isinstance(content, str) else content
    return np.frombuffer(content, dtype, count=1)[0]


def _bytes(text: str, encoding: str) -> bytes:
    """How pickles of protocol 2 write bytes."""
    if encoding not in ("latin1", "latin-1"):
        raise SurefixValueError(f"bytes of {encoding!r}, which is not read")
    return text.encode("latin-1")


_CORE = ("numpy.core.multiarray", "numpy._core.multiarray")
_MAKERS: dict[str, tuple[tuple[str, ...], Any]] = {
    "_reconstruct": (_CORE, _array),
    "scalar": (_CORE, _scalar),
    "ndarray": (("numpy",), np.ndarray),
    "dtype": (("numpy",), np.dtype),
    "encode": (("_codecs",), _bytes),
}
