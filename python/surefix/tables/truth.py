"""Ground truth: the identity, an array, or a table."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix.errors import mismatch
from surefix.tables.npy import read_npy
from surefix.tables.rows import rows

COLUMNS = ["query", "reference"]


def read_truth(source: str | Path, places: int, queries: int) -> npt.NDArray[Any]:
    """The truth, as ``surefix.evaluate`` takes it: "identity"; a ``.npy`` of places (m,) or of a
    matrix (n, m); or a ``.csv`` with the columns query and reference, a row a query, with -1 or an
    empty cell for a query without a place.
    """
    if source == "identity":
        if queries > places:
            got = f"{places} places and {queries} queries"
            raise mismatch("--truth identity", "a place for every query", got)
        return np.arange(queries)
    path = Path(source)
    if path.suffix == ".npy":
        return _array(path, places, queries)
    if path.suffix == ".csv":
        return _table(path, places, queries)
    raise mismatch("truth", '"identity", a .npy or a .csv', repr(str(source)))


def _array(path: Path, places: int, queries: int) -> npt.NDArray[Any]:
    array = read_npy(path, "the truth")
    if array.shape not in ((queries,), (places, queries)) or array.dtype.kind not in "biu":
        expected = f"places, int ({queries},), or a matrix, bool or int ({places}, {queries})"
        raise mismatch(path, expected, f"{array.dtype} {array.shape}")
    truth = array if array.ndim == 2 and array.dtype == np.bool_ else array.astype(np.int64)
    one_a_query = array.ndim == 1
    wrong = np.argwhere((truth < -1) | (truth >= (places if one_a_query else 2)))
    if len(wrong) and one_a_query:
        got = f"{truth[wrong[0, 0]]} in row {wrong[0, 0]}"
        raise mismatch(path, f"places from 0 to {places - 1}, or -1 for none", got)
    if len(wrong):
        place, query = wrong[0]
        got = f"{array[place, query]} in row {place}, column {query}"
        raise mismatch(path, "1 (the same place), 0 (not) or -1 (ignored)", got)
    return truth


def _table(path: Path, places: int, queries: int) -> npt.NDArray[np.int64]:
    """Places (m,); the header may be left out, then there are no other columns."""
    found: dict[int, tuple[int, int]] = {}
    header = COLUMNS
    for count, (row, cells) in enumerate(rows(path, ",")):
        if count == 0 and not any(_is_whole(cell) for cell in cells):
            header = [cell.lower() for cell in cells]
            if not set(COLUMNS) <= set(header):
                raise mismatch(f"{path}, row {row}", "the columns query,reference", ",".join(cells))
            continue
        if len(cells) != len(header):
            expected = f"{len(header)} values, {','.join(header)}"
            raise mismatch(f"{path}, row {row}", expected, len(cells))
        given, there = (cells[header.index(column)] for column in COLUMNS)
        query = _cell(path, row, "query", given, 0, queries)
        place = -1 if there == "" else _cell(path, row, "reference", there, -1, places)
        before, at = found.setdefault(query, (place, row))
        if before != place:
            got = f"{place} for query {query}, which has {before} in row {at}"
            advice = f"several places a query are a matrix, a .npy ({places}, {queries})"
            raise mismatch(f"{path}, row {row}", "one reference a query", f"{got}; {advice}")
    if not found:
        raise mismatch(path, "rows of query,reference", "none")
    missing = [query for query in range(queries) if query not in found]
    if missing:
        first = f"the first that lacks one is {missing[0]} (reference -1 or empty for none)"
        raise mismatch(path, f"a row for each of the {queries} queries", f"{len(found)}; {first}")
    return np.array([found[query][0] for query in range(queries)], np.int64)


def _is_whole(cell: str) -> bool:
    return cell.removeprefix("-").isdecimal()


def _cell(path: Path, row: int, column: str, cell: str, low: int, count: int) -> int:
    if not _is_whole(cell) or not low <= int(cell) < count:
        none = ", or -1 for none" if low < 0 else ""
        expected = f"a whole number from 0 to {count - 1}{none}"
        raise mismatch(f"{path}, row {row}, column {column}", expected, repr(cell))
    return int(cell)
