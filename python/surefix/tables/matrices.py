"""Ready distances."""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from surefix.errors import SurefixError, mismatch
from surefix.tables.columns import MatrixColumns, is_held
from surefix.tables.npy import read_npy
from surefix.tables.regular import check_room, within_memory


def read_matrix(path: str | Path, similarity: bool = False) -> npt.NDArray[np.float32]:
    """The distances in a ``.npy``, a row a place; of similarities ``s`` they are ``1 - s``."""
    matrix = read_npy(path, "the matrix")
    if matrix.ndim != 2 or matrix.dtype.kind not in "fiu" or len(matrix) < 2 or not matrix.size:
        expected = "a matrix of numbers, (2 or more places, 1 or more queries)"
        raise mismatch(path, expected, f"{matrix.dtype} {matrix.shape}")
    check_room(4 * matrix.size, path)
    with within_memory(path):
        values = np.empty(matrix.shape, np.float32)
    # Row by row: in float64, as similarities are subtracted, a large one would not fit.
    for place, row in enumerate(matrix):
        if not np.isfinite(row).all():
            query = int(np.argmin(np.isfinite(row)))
            raise mismatch(path, "finite numbers", f"{row[query]} at place {place}, query {query}")
        values[place] = 1 - row.astype(np.float64) if similarity else row
    return values


def large_matrix(path: str | Path, similarity: bool = False) -> MatrixColumns | None:
    """The columns of a ``.npy`` that is too large to be held; None if it is not, or is no matrix:
    ``read_matrix`` says why.
    """
    try:
        columns = MatrixColumns(path, similarity)
    except SurefixError:
        return None
    return None if is_held(*columns.shape) else columns
