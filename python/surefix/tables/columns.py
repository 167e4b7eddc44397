"""Distances that are too many to hold: read, or made, some columns at a time."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from surefix.errors import SurefixValueError, mismatch, refusal
from surefix.tables.objects import header_of
from surefix.tables.regular import check_regular

Float32 = npt.NDArray[np.float32]

# Bytes of a matrix that is held whole, and of one block of the columns of a larger one.
HELD, BLOCK = 128 << 20, 32 << 20


def is_held(places: int, queries: int) -> bool:
    """Whether the distances are few enough to be held whole."""
    return 4 * places * queries <= HELD


class Columns(ABC):
    """Distances between places and queries, in blocks of consecutive columns.

    ``shape`` is (places, queries).
    """

    shape: tuple[int, int]

    def __len__(self) -> int:
        """The number of places."""
        return self.shape[0]

    @property
    def width(self) -> int:
        """The number of columns of a block."""
        return max(1, BLOCK // (4 * self.shape[0]))

    @abstractmethod
    def block(self, start: int, stop: int) -> Float32:
        """Some columns, (places, stop - start), those of a query consecutive in memory."""

    def blocks(self) -> Iterator[tuple[int, Float32]]:
        """The first query of each block, and its columns."""
        for start in range(0, self.shape[1], self.width):
            yield start, self.block(start, min(start + self.width, self.shape[1]))


class MatrixColumns(Columns):
    """Those of a ``.npy``, which is read anew for each block; of similarities ``s``: ``1 - s``."""

    def __init__(self, path: str | Path, similarity: bool = False) -> None:
        self.path, self.similarity = Path(path), similarity
        length = check_regular(path, "cannot read the matrix")
        try:
            with self.path.open("rb") as file:
                self.shape, self._fortran, self._dtype = _header(file)
                self._start = file.tell()
        except OSError as error:
            raise refusal(path, "cannot read the matrix", error) from None
        except (ValueError, EOFError) as error:
            said = f"not a .npy array, or a truncated one ({error})"
            raise SurefixValueError(f"{path}: {said}") from None
        places, queries = self.shape
        size = self._start + places * queries * self._dtype.itemsize
        if length < size:
            raise mismatch(path, f"a whole .npy of {size} bytes", f"{length} bytes")

    def block(self, start: int, stop: int) -> Float32:
        """Some columns, checked to be finite."""
        places, queries = self.shape
        item, count = self._dtype.itemsize, stop - start
        with self.path.open("rb", buffering=0) as file:
            if self._fortran:
                file.seek(self._start + start * places * item)
                raw = _exactly(file, count * places * item)
                read = np.frombuffer(raw, self._dtype).reshape(count, places).T
            else:
                read = np.empty((count, places), self._dtype).T
                for place in range(places):
                    file.seek(self._start + (place * queries + start) * item)
                    read[place] = np.frombuffer(_exactly(file, count * item), self._dtype)
        if not np.isfinite(read).all():
            place, query = np.argwhere(~np.isfinite(read))[0]
            got = f"{read[place, query]} at place {place}, query {start + query}"
            raise mismatch(self.path, "finite numbers", got)
        values = 1 - read.astype(np.float64) if self.similarity else read
        return np.asfortranarray(values, np.float32)


def _header(file: BinaryIO) -> tuple[tuple[int, int], bool, Any]:
    shape, fortran, dtype, _ = header_of(file)
    if len(shape) != 2 or dtype.kind not in "fiu" or shape[0] < 2 or not shape[1]:
        raise ValueError(f"{dtype} {shape} is no matrix of distances")
    return (shape[0], shape[1]), fortran, dtype


def _exactly(file: Any, size: int) -> bytes:
    """So many bytes: a read may return fewer."""
    parts = []
    while size:
        part = file.read(size)
        if not part:
            raise EOFError("the file ends before its last row")
        parts.append(part)
        size -= len(part)
    return parts[0] if len(parts) == 1 else b"".join(parts)
