"""Ready distances."""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from surefix.errors import mismatch
from surefix.tables.npy import read_npy


def read_matrix(path: str | Path, similarity: bool = False) -> npt.NDArray[np.float32]:
    """The distances in a ``.npy``, a row a place; of similarities ``s`` they are ``1 - s``."""
    matrix = read_npy(path, "the matrix")
    if matrix.ndim != 2 or matrix.dtype.kind not in "fiu" or len(matrix) < 2 or not matrix.size:
        expected = "a matrix of numbers, (2 or more places, 1 or more queries)"
        raise mismatch(path, expected, f"{matrix.dtype} {matrix.shape}")
    values = matrix.astype(np.float64)
    if not np.isfinite(values).all():
        place, query = np.argwhere(~np.isfinite(values))[0]
        got = f"{values[place, query]} at place {place}, query {query}"
        raise mismatch(path, "finite numbers", got)
    return (1 - values if similarity else values).astype(np.float32)
