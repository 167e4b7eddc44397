"""What the command line takes as ground truth: the identity, an array, a table, or positions."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix import SurefixFileError, SurefixValueError
from surefix.datasets.rows import rows

__all__ = ["read_truth", "truth_by_position"]


def read_truth(text: str, places: int, queries: int) -> npt.NDArray[Any]:
    """The truth of ``--truth``, as ``surefix.evaluate`` takes it.

    Parameters ---------- text : str "identity", a ``.npy`` of places (m,) or of a matrix (n, m), or
    a ``.csv`` with the columns query and reference, a row a query; -1 or empty where there is no
    place. places, queries : int How many there are.

    Raises
    ------
    SurefixError
        Where the file cannot be read, or does not fit; it says where.
    """
    if text == "identity":
        if queries > places:
            raise SurefixValueError(
                f"--truth identity: expected a place for every query, got {places} places and {queries} queries"
            )
        return np.arange(queries)
    file = Path(text)
    if file.suffix == ".npy":
        return _array(file, places, queries)
    if file.suffix == ".csv":
        return _table(file, places, queries)
    raise SurefixValueError(f'--truth: expected "identity", a .npy or a .csv, got {text!r}')


def truth_by_position(
    reference: npt.NDArray[np.float64], query: npt.NDArray[np.float64], places: int, queries: int
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Positions as ``surefix.evaluate`` takes them.

    Raises
    ------
    SurefixValueError
        Where their number, or that of their coordinates, does not fit.
    """
    for option, array, count in (
        ("--positions", reference, places),
        ("--query-positions", query, queries),
    ):
        if array.ndim != 2 or array.shape[1] not in (2, 3) or len(array) != count:
            raise SurefixValueError(
                f"{option}: expected {count} rows of 2 or 3 metres, got the shape {array.shape}"
            )
        if not np.isfinite(array).all():
            row = int(np.argmin(np.isfinite(array).all(axis=1)))
            raise SurefixValueError(
                f"{option}: expected finite metres, got {array[row].tolist()} in row {row}"
            )
    if reference.shape[1] != query.shape[1]:
        got = f"{reference.shape[1]} of places and {query.shape[1]} of queries"
        raise SurefixValueError(
            f"--query-positions: expected as many coordinates as --positions, got {got}"
        )
    return reference, query


def _array(file: Path, places: int, queries: int) -> npt.NDArray[Any]:
    try:
        array: npt.NDArray[Any] = np.load(file, allow_pickle=False)
    except OSError as error:
        raise SurefixFileError(
            f"{file}: cannot read the truth: {error.strerror or error}"
        ) from None
    except (ValueError, EOFError) as error:
        raise SurefixValueError(f"{file}: not a .npy array, or a truncated one ({error})") from None
    if array.shape not in ((queries,), (places, queries)) or array.dtype.kind not in "biu":
        expected = f"places, int ({queries},), or a matrix, bool or int ({places}, {queries})"
        raise SurefixValueError(f"{file}: expected {expected}, got {array.dtype} {array.shape}")
    if array.ndim == 1:
        _check_places(file, array.astype(np.int64), places)
        return array.astype(np.int64)
    wrong = np.argwhere(~np.isin(array.astype(np.int64), (-1, 0, 1)))
    if len(wrong):
        place, query = wrong[0]
        got = f"{array[place, query]} in row {place}, column {query}"
        raise SurefixValueError(
            f"{file}: expected 1 (the same place), 0 (not) or -1 (ignored), got {got}"
        )
    return array if array.dtype == np.bool_ else array.astype(np.int64)


def _check_places(file: Path, truth: npt.NDArray[np.int64], places: int) -> None:
    wrong = np.flatnonzero((truth < -1) | (truth >= places))
    if len(wrong):
        got = f"{truth[wrong[0]]} in row {wrong[0]}"
        raise SurefixValueError(
            f"{file}: expected places from 0 to {places - 1}, or -1 where there is none, got {got}"
        )


def _table(file: Path, places: int, queries: int) -> npt.NDArray[np.int64]:
    """Places (m,), one row a query."""
    found: dict[int, tuple[int, int]] = {}
    for count, (row, cells) in enumerate(rows(file, ",")):
        if count == 0 and len(cells) == 2 and not any(_whole(cell) for cell in cells):
            if [cell.lower() for cell in cells] != ["query", "reference"]:
                raise SurefixValueError(
                    f"{file}, row {row}: expected the columns query,reference, got {','.join(cells)}"
                )
            continue
        if len(cells) != 2:
            raise SurefixValueError(
                f"{file}, row {row}: expected 2 values, query,reference, got {len(cells)}"
            )
        query = _cell(file, row, "query", cells[0], 0, queries)
        place = -1 if cells[1] == "" else _cell(file, row, "reference", cells[1], -1, places)
        before, at = found.setdefault(query, (place, row))
        if before != place:
            raise SurefixValueError(
                f"{file}, row {row}: expected one reference a query, got {place} for query {query}, which has {before} "
                f"in row {at}; several places a query are a matrix, a .npy ({places}, {queries})"
            )
    if not found:
        raise SurefixValueError(f"{file}: expected rows of query,reference, got none")
    missing = [query for query in range(queries) if query not in found]
    if missing:
        raise SurefixValueError(
            f"{file}: expected a row for each of the {queries} queries (reference -1 or empty where there is none), "
            f"got {len(found)}; the first that lacks one is {missing[0]}"
        )
    return np.array([found[query][0] for query in range(queries)], np.int64)


def _whole(cell: str) -> bool:
    return cell.removeprefix("-").isdecimal()


def _cell(file: Path, row: int, column: str, cell: str, low: int, count: int) -> int:
    if not _whole(cell) or not low <= int(cell) < count:
        none = ", or -1 where there is none" if low < 0 else ""
        got = f"got {cell!r}"
        raise SurefixValueError(
            f"{file}, row {row}, column {column}: expected a whole number from 0 to {count - 1}{none}, {got}"
        )
    return int(cell)
