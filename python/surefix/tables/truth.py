"""Ground truth: the identity, an array, or a table, as people have them."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix.errors import SurefixError, mismatch
from surefix.tables.npy import names_in, read_npy
from surefix.tables.rows import UNKNOWN, cells_of, is_number, read_text

COLUMNS = ["query", "reference"]
# Other headings of these two columns.
HEADINGS = {
    "query": "query q queries query_id query_index query_idx query_frame frame",
    "reference": "reference ref references place places database db map match truth gt true_place "
    "ground_truth reference_id reference_index reference_idx database_index db_index db_idx "
    "place_id ref_id ref_index",
}
_MEANS = {name: key for key, names in HEADINGS.items() for name in names.split()}
# Arrays of a .npz that are a truth, by their name.
KEYS = ("truth", "gt", "ground_truth", "GThard", "GT", "positives")
# Patch-NetVLAD's ground truth: positions of queries and of places, and its tolerance.
OF_QUERIES, OF_PLACES, METRES = "utmQ", "utmDb", "posDistThr"
EXPECTED, MORE = '"identity", a .npy or a .csv', "; a .npz, .json, .txt or .tsv will do too"


@dataclass(frozen=True, eq=False)
class PositionTruth:
    """A truth that is positions in metres, and the tolerance that the file names, if it does."""

    places: npt.NDArray[np.float64]
    queries: npt.NDArray[np.float64]
    metres: float | None


def read_position_truth(source: str | Path) -> PositionTruth | None:
    """Patch-NetVLAD's ``.npz`` of ``utmQ`` and ``utmDb``; None for any other truth."""
    path = Path(source)
    if path.suffix.lower() != ".npz" or not {OF_QUERIES, OF_PLACES} <= {*names_in(path, "it")}:
        return None
    places, queries = (
        np.asarray(read_npy(path, "the truth", keys=(key,)), np.float64)
        for key in (OF_PLACES, OF_QUERIES)
    )
    metres = None
    if METRES in names_in(path, "it"):
        metres = float(read_npy(path, "the truth", keys=(METRES,)).ravel()[0])
    return PositionTruth(places, queries, metres)


def read_truth(source: str | Path, places: int, queries: int) -> npt.NDArray[Any]:
    """The truth, as ``surefix.evaluate`` takes it.

    - "identity": query i is place i;
    - ``.npy``, or the one array of a ``.npz``: places (m,), (m, 1) or (1, m), whole numbers of any
      type, -1 for none, NaN for one that is not known; pairs of a query and a place (k, 2); a
      matrix (n, m); several right places a query, as lists, or as rows filled up with -1;
    - ``.json``: a list with an item a query, a place or a list of them;
    - a table: the columns query and reference, by their names or in this order, or the place alone,
      a row a query; an empty or -1 reference for none, ``nan`` for one that is not known.
    """
    if source == "identity":
        if queries > places:
            got = f"{places} places and {queries} queries"
            raise mismatch("--truth identity", "a place for every query", got)
        return np.arange(queries)
    path = Path(source)
    suffix = path.suffix.lower()
    if suffix in (".npy", ".npz"):
        read = read_npy(path, "the truth", keys=KEYS, objects=True)
        return _array(path, read, places, queries)
    if suffix == ".json":
        return _of_json(path, places, queries)
    if suffix in (".csv", ".txt", ".tsv", ".dat", ".tab"):
        return _table(path, places, queries)
    raise mismatch("truth", EXPECTED, repr(str(source)) + MORE)


def _array(path: Path, array: npt.NDArray[Any], places: int, queries: int) -> npt.NDArray[Any]:
    if array.dtype == object:
        return _lists(path, array.tolist(), places, queries)
    expected = (
        f"places, int ({queries},), pairs of a query and a place, int (k, 2), or a matrix, bool or "
        f"int ({places}, {queries})"
    )
    refused = mismatch(path, expected, f"{array.dtype} {array.shape}")
    if array.dtype.kind not in "biuf" or array.ndim not in (1, 2):
        raise refused
    if array.dtype.kind == "f":
        array = _whole(path, array)
    if array.shape in ((queries,), (queries, 1), (1, queries)) and array.dtype.kind != "b":
        return _places(path, array.ravel(), places)
    if array.shape == (places, queries):
        return _matrix(path, array)
    if array.dtype.kind == "b" or array.ndim != 2:
        raise refused
    if array.shape == (queries, places) and np.isin(array, (-1, 0, 1)).all():
        return _matrix(path, array.T)
    if array.shape[1] == 2 and _are_pairs(array, queries):
        return _pairs(path, array, places, queries)
    if len(array) == queries and array.shape[1] < places:
        return _lists(path, array.tolist(), places, queries)
    raise refused


def _whole(path: Path, array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Floats that are whole as integers; with a NaN they stay floats."""
    known = ~np.isnan(array)
    part = np.argwhere(known & (array != np.round(array)))
    if len(part):
        at = tuple(part[0])
        raise mismatch(path, "whole numbers", f"{array[at]} in row {at[0]}")
    return array if not known.all() else array.astype(np.int64)


def _places(path: Path, truth: npt.NDArray[Any], places: int) -> npt.NDArray[Any]:
    """A place a query."""
    truth = truth if truth.dtype.kind == "f" else truth.astype(np.int64)
    wrong = np.flatnonzero((truth < -1) | (truth >= places))
    if len(wrong):
        got = f"{truth[wrong[0]]:g} in row {wrong[0]}"
        known = truth[truth >= 0]
        raise mismatch(
            path, f"places from 0 to {places - 1}, or -1 for none", got + _from_one(known, places)
        )
    return truth


def _from_one(given: npt.NDArray[Any], count: int) -> str:
    """The advice for numbers that begin with 1 and end with the count."""
    from_one = len(given) > 0 and given.min() >= 1 and given.max() == count
    return "; the numbers seem to count from 1, subtract 1" if from_one else ""


def _matrix(path: Path, array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    if array.dtype == np.bool_:
        return array
    wrong = np.argwhere(~np.isin(array, (-1, 0, 1)))
    if len(wrong):
        place, query = wrong[0]
        got = f"{array[place, query]} in row {place}, column {query}"
        raise mismatch(path, "1 (the same place), 0 (not) or -1 (ignored)", got)
    return array.astype(np.int8)


def _are_pairs(array: npt.NDArray[Any], queries: int) -> bool:
    """Whether the first column is the queries, once or several times each."""
    first = np.unique(array[:, 0])
    return len(first) == queries and first[0] in (0, 1) and bool(first[-1] - first[0] < queries)


def _pairs(path: Path, array: npt.NDArray[Any], places: int, queries: int) -> npt.NDArray[Any]:
    first = array[:, 0].astype(np.int64)
    if first.max() >= queries:
        raise mismatch(path, f"queries from 0 to {queries - 1}", f"1 to {queries}: subtract 1")
    items: list[list[Any]] = [[] for _ in range(queries)]
    for query, place in zip(first.tolist(), array[:, 1].tolist(), strict=True):
        items[query].append(place)
    return _lists(path, items, places, queries)


def _lists(path: Path, items: Sequence[Any], places: int, queries: int) -> npt.NDArray[Any]:
    """An item a query: a place or several; AnyLoc's have the query's number before the list."""
    if len(items) != queries:
        raise mismatch(path, f"an item for each of the {queries} queries", len(items))
    numbered = [
        isinstance(item, (list, tuple))
        and len(item) == 2
        and np.ndim(item[0]) == 0
        and isinstance(item[1], (list, tuple, np.ndarray))
        for item in items
    ]
    if items and all(numbered):
        order = [int(item[0]) for item in items]
        if sorted(order) != list(range(queries)):
            raise mismatch(path, f"the queries 0 to {queries - 1}, once each", order[:5])
        items = [item[1] for _, item in sorted(zip(order, items, strict=True))]
    lists = [_numbers(path, query, item) for query, item in enumerate(items)]
    if all(len(each) == 1 for each in lists):
        return _places(path, _whole(path, np.array([each[0] for each in lists])), places)
    cells = np.zeros((places, queries), np.int8)
    every = np.concatenate([each[each >= 0] for each in lists])
    for query, each in enumerate(lists):
        if np.isnan(each).any():
            # Not known: no match of this query is judged.
            cells[:, query] = -1
            continue
        right = _whole(path, each[each != -1]).astype(np.int64)
        wrong = right[(right < 0) | (right >= places)]
        if len(wrong):
            got = f"{wrong[0]} for query {query}{_from_one(every, places)}"
            raise mismatch(path, f"places from 0 to {places - 1}", got)
        cells[right, query] = 1
    return cells


def _numbers(path: Path, query: int, item: Any) -> npt.NDArray[np.float64]:
    """The places of a query as floats."""
    item = np.nan if item is None else item
    try:
        values = np.asarray(item, np.float64).ravel()
    except (TypeError, ValueError):
        values = None
    if values is None or isinstance(item, (str, bytes)):
        raise mismatch(path, "a place or a list of places a query", f"{item!r} for query {query}")
    return values


def _of_json(path: Path, places: int, queries: int) -> npt.NDArray[Any]:
    try:
        read = json.loads(read_text(path, "the truth"))
    except (ValueError, RecursionError) as error:
        if isinstance(error, SurefixError):
            raise
        raise mismatch(path, "a list in JSON", error) from None
    if isinstance(read, dict):
        missing = [query for query in range(queries) if str(query) not in read]
        if missing or len(read) != queries:
            got = f"{len(read)} keys" + (f", none for query {missing[0]}" if missing else "")
            raise mismatch(path, f"the keys 0 to {queries - 1}", got)
        read = [read[str(query)] for query in range(queries)]
    if not isinstance(read, list):
        raise mismatch(path, "a list with an item a query", type(read).__name__)
    return _lists(path, read, places, queries)


def _table(path: Path, places: int, queries: int) -> npt.NDArray[Any]:
    """Places (m,), or a matrix; the header may be left out if there are no other columns."""
    table = cells_of(path, "the truth")
    header = _header(table[0][1]) if table else None
    if header is not None:
        if "reference" not in header:
            got = ",".join(table[0][1])
            raise mismatch(f"{path}, row {table[0][0]}", "the columns query,reference", got)
        table = table[1:]
    width = len(header) if header else len(table[0][1]) if table else 0
    if header is None:
        if width == queries and len(table) == places and width > 2:
            matrix = [[_cell(path, row, "", c, -1, 2) for c in cells] for row, cells in table]
            return _matrix(path, np.array(matrix).astype(np.int64))
        header = ["reference"] if width == 1 else COLUMNS
    found: dict[int, tuple[float, int]] = {}
    several = f"several places a query are a matrix, a .npy ({places}, {queries})"
    from_one = _table_from_one(table, header, places, queries)
    for order, (row, cells) in enumerate(table):
        if len(cells) != len(header):
            expected = f"{len(header)} values, {','.join(header)}"
            raise mismatch(f"{path}, row {row}", expected, len(cells))
        query = order
        if "query" in header:
            cell = cells[header.index("query")]
            query = int(_cell(path, row, "query", cell, 0, queries, from_one))
        there = cells[header.index("reference")]
        place = -1.0 if there == "" else _cell(path, row, "reference", there, -1, places, from_one)
        before, at = found.setdefault(query, (place, row))
        if before != place and not (np.isnan(before) and np.isnan(place)):
            got = f"{place:g} for query {query}, which has {before:g} in row {at}"
            raise mismatch(f"{path}, row {row}", "one reference a query", f"{got}; {several}")
    if not found:
        raise mismatch(path, "rows of query,reference", "none")
    missing = [query for query in range(queries) if query not in found]
    if missing or len(found) > queries:
        first = f"the first that lacks one is {missing[0]} (reference -1 or empty for none)"
        got = f"{len(found)}; {first}" if missing else str(len(found))
        raise mismatch(path, f"a row for each of the {queries} queries", got)
    return _whole(path, np.array([found[query][0] for query in range(queries)]))


def _header(cells: list[str]) -> list[str] | None:
    """The columns' names, ``query`` and ``reference`` among them if they are known; None without a
    header. pandas writes an index, whose heading is empty, and a series as the column 0.
    """
    names = [cell.lower().replace(" ", "_").replace("-", "_") for cell in cells]
    if len(names) == 2 and names[0] == "" and (is_number(names[1]) or names[1] in _MEANS):
        return COLUMNS
    if any(is_number(cell) for cell in cells if cell.lower() not in UNKNOWN):
        return None
    known = [_MEANS.get(name, name) for name in names]
    # Of two columns of one meaning the one with the usual name is it.
    for meaning in COLUMNS:
        same = [index for index, name in enumerate(known) if name == meaning]
        own = next((index for index in same if names[index] == meaning), same[0] if same else -1)
        for index in same:
            known[index] = meaning if index == own else names[index] + " too"
    if len(known) == 1 and known != ["reference"]:
        return ["reference"] if names[0] in ("query", "0") else known
    return known


def _table_from_one(
    table: list[tuple[int, list[str]]], header: list[str], places: int, queries: int
) -> str:
    """The advice, if a column counts from 1."""
    for name, count in (("query", queries), ("reference", places)):
        if name in header:
            at = header.index(name)
            cells = [cells[at] for _, cells in table if len(cells) > at]
            given = np.array([float(cell) for cell in cells if is_number(cell)])
            advice = _from_one(given[given >= 0], count)
            if advice:
                return advice
    return ""


def _cell(
    path: Path, row: int, column: str, cell: str, low: int, count: int, advice: str = ""
) -> float:
    """A whole number, which may be written as 7.0; NaN for one that is not known."""
    value = float(cell) if is_number(cell) else None
    if low < 0 and cell.lower() in UNKNOWN:
        return float("nan")
    if value is None or not value.is_integer() or not low <= value < count:
        none = ", or -1 for none" if low < 0 else ""
        expected = f"a whole number from 0 to {count - 1}{none}"
        where = f"{path}, row {row}" + (f", column {column}" if column else "")
        raise mismatch(where, expected, repr(cell) + advice)
    return value
