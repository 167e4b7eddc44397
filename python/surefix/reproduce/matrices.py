"""Ready distance matrices of any technique."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix.baselines.distances import Distances
from surefix.baselines.truth import Truth
from surefix.errors import SurefixFileError, SurefixValueError
from surefix.reproduce.case import Case

__all__ = ["as_distances", "matrix_case", "read_matrix"]


def matrix_case(text: str, *, similarity: bool = False) -> Case:
    """A case from ``NAME=FILE.npy`` or ``NAME=FILE.npy,TRUTH.npy``.

    Parameters
    ----------
    text : str
        ``NAME`` is ``DATASET/TECHNIQUE``, or a technique alone. The matrix has a row a place and a
        column a query. The truth is as for ``surefix.evaluate``, (m,) or (n, m); without one, and
        as many queries as places, query ``i`` shows place ``i``.
    similarity : bool
        More is more alike: the distance is 1 minus that.

    Raises
    ------
    SurefixError
        For another form, a file that cannot be read, or arrays that do not fit each other.
    """
    name, equals, files = text.partition("=")
    if not (name and equals and files):
        raise SurefixValueError(
            f"--matrix: expected NAME=FILE.npy or NAME=FILE.npy,TRUTH.npy, got {text!r}"
        )
    file, _, truth_file = files.partition(",")
    dataset, slash, technique = name.partition("/")
    if not slash:
        dataset, technique = Path(file).resolve().parent.name or "matrix", name
    D = as_distances(read_matrix(Path(file)), similarity, file)
    notes: tuple[str, ...] = ()
    truth: Truth
    if truth_file:
        truth = _load(Path(truth_file), "the truth")
    elif D.shape[0] == D.shape[1]:
        truth = np.arange(D.shape[1], dtype=np.int64)
        notes = ("No truth was given: query i is taken to show place i.",)
    else:
        raise SurefixValueError(
            f"--matrix {name}: expected FILE.npy,TRUTH.npy, as {D.shape[0]} places and {D.shape[1]} queries "
            "cannot be paired one to one"
        )
    return Case(
        dataset, technique, D, truth, source=f"ready {kind(similarity)}, {file}", notes=notes
    )


def read_matrix(path: Path) -> npt.NDArray[Any]:
    """A matrix of numbers, a row a place and a column a query."""
    matrix = _load(path, "the matrix")
    if matrix.ndim != 2 or matrix.dtype.kind not in "fiu" or 0 in matrix.shape:
        raise SurefixValueError(
            f"{path}: expected numbers (places, queries), got {matrix.dtype} {matrix.shape}"
        )
    return matrix


def as_distances(matrix: npt.NDArray[Any], similarity: bool, where: object) -> Distances:
    """As float32 distances."""
    values = matrix.astype(np.float64)
    if not np.isfinite(values).all():
        place, query = np.argwhere(~np.isfinite(values))[0].tolist()
        raise SurefixValueError(
            f"{where}: expected finite numbers, got {values[place, query]} at [{place}, {query}]"
        )
    return (1 - values if similarity else values).astype(np.float32)


def kind(similarity: bool) -> str:
    """What the matrix holds."""
    return "similarities" if similarity else "distances"


def _load(path: Path, what: str) -> npt.NDArray[Any]:
    try:
        array: npt.NDArray[Any] = np.load(path, allow_pickle=False)
    except OSError as error:
        raise SurefixFileError(f"{path}: cannot read {what}: {error.strerror or error}") from None
    except (ValueError, EOFError) as error:
        raise SurefixValueError(
            f"{path}: not a .npy array of numbers, or a truncated one ({error})"
        ) from None
    return array
