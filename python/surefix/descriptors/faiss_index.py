"""The vectors in a flat faiss index, and the metric that it compares them by."""

from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from surefix._extra import needed
from surefix.errors import SurefixValueError

__all__ = ["read_index"]

# How far from 1 the length of a normalised float32 vector may be.
UNIT = 1e-3


def read_index(path: Path) -> tuple[npt.NDArray[np.float32], Literal["cosine", "euclidean"]]:
    """The vectors, (n, dim), and the metric.

    Raises
    ------
    SurefixValueError
        Where it is no faiss index, or one that does not hold the vectors themselves in their order.
    SurefixError
        Where faiss is missing.
    """
    library = needed("faiss", "a faiss index", "faiss", "surefix[files]")
    try:
        index: Any = library.read_index(str(path))
    except RuntimeError as error:
        reason = str(error).strip().split("\n")[-1]
        raise SurefixValueError(
            f"{path}: not a faiss index, or a truncated one ({reason})"
        ) from None
    if not isinstance(index, library.IndexFlat):
        raise SurefixValueError(
            f"{path}: expected a flat index (IndexFlatL2, IndexFlatIP), which holds the vectors themselves in their "
            f"order, got {type(index).__name__}"
        )
    rows: npt.NDArray[np.float32] = np.empty((0, index.d), np.float32)
    if index.ntotal:
        rows = index.reconstruct_n(0, index.ntotal)
    if index.metric_type == library.METRIC_L2:
        return rows, "euclidean"
    if index.metric_type != library.METRIC_INNER_PRODUCT:
        raise SurefixValueError(
            f"{path}: expected an index of L2 or of inner products, got metric {index.metric_type}"
        )
    lengths = np.linalg.norm(rows.astype(np.float64), axis=1)
    if len(rows) and np.abs(lengths - 1).max() > UNIT:
        raise SurefixValueError(
            f"{path}: expected vectors of unit length in an index of inner products, which are cosines then, "
            f"got lengths from {lengths.min():.4g} to {lengths.max():.4g}"
        )
    return rows, "cosine"
