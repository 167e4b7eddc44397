"""The matches in a report's folder, and in the fixes of a run."""

import csv
import hashlib
import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from surefix.errors import SurefixValueError, mismatch
from surefix.judged import RECALLS, Judged, SingleMatches
from surefix.matches import Matches
from surefix.tables.rows import decimal, read_text, rows, whole

__all__ = ["FixFile", "chosen", "drive_of", "is_report", "labels", "read_fixes", "read_report"]

FIXES, METHODS, DRIVE = "fixes.csv", "methods.csv", "drive.csv"
# Lies in a folder whose files are of two reports (``src/archive/folder.rs``).
REPLACING = ".replacing.part"
# Of files of one name and size, the middle of a few of them tells.
LOOKED_AT, BYTES = 16, 4096
OF_REPORT = (
    "method", "query", "name", "score", "ready", "accepted", "judged", "right", "true_place",
    "trusted",
)  # fmt: skip
OF_RUN = ("query", "place", "score", "ready", "trusted", "single_place")
WEIGHTED = "weighted"

T = TypeVar("T")
Cells = dict[str, list[str]]


def is_report(path: Path) -> bool:
    """Whether a path is a folder, or the table of all methods' fixes in one."""
    if path.is_dir():
        return True
    if path.suffix.lower() != ".csv" or not path.is_file():
        return False
    return next(rows(path, ",", "the fixes"), (0, [""]))[1][0] == "method"


def read_report(path: Path) -> list[Judged]:
    """The matches of each method of a report of ``surefix eval``: its folder, or its fixes.csv.

    Raises
    ------
    SurefixFileError
        If a file cannot be read.
    SurefixValueError
        If the folder is no report, or a table has other columns or cells.
    """
    folder = path if path.is_dir() else path.parent
    if not path.exists():
        raise mismatch(path, "the folder of a report, by surefix eval -o", "nothing there")
    if (folder / REPLACING).exists():
        said = "one that was stopped while its files were replaced, or is being replaced"
        raise mismatch(folder, "a whole report", f"{said}: make it again")
    for name in (FIXES, METHODS):
        if not (folder / name).is_file():
            expected = f"the folder of a report, by surefix eval -o, with {name} in it"
            raise mismatch(folder, expected, "none")
    _, methods = _table(folder / METHODS, ("method", "recall_convention"))
    recalls = dict(zip(methods["method"], methods["recall_convention"], strict=True))
    drive = None
    if (folder / DRIVE).is_file():
        _, facts = _table(folder / DRIVE, ("quantity", "value"))
        drive = dict(zip(facts["quantity"], facts["value"], strict=True)).get("drive")
    file = folder / FIXES
    numbers, cells = _table(file, OF_REPORT)
    read = _Reader(file, numbers, cells)
    names, at = np.array(cells["method"]), {name: k for k, name in enumerate(cells["method"])}
    made = []
    for method in sorted(at, key=cells["method"].index):
        recall = recalls.get(method)
        if recall not in RECALLS:
            said = f"a line for the method {method} with one of {', '.join(RECALLS)}"
            raise mismatch(folder / METHODS, said, recall or "none")
        rows_ = np.flatnonzero(names == method)
        one = read.taken(rows_)
        named = [cells["name"][row] for row in rows_]
        single = None
        if "single_right" in cells:
            judged = np.array([cells["single_right"][row] != "" for row in rows_])
            single = SingleMatches(one.flags("trusted"), one.flags("single_right"), judged)
        off = None
        if "off_map" in cells and all(cells["off_map"][row] for row in rows_):
            off = one.floats("off_map")
        made.append(
            Judged(
                method,
                one.scores(),
                one.flags("ready"),
                one.flags("accepted"),
                one.flags("right"),
                one.flags("judged"),
                one.wholes("true_place"),
                single,
                off,
                named if all(named) else None,
                recall,
                drive,
            )
        )
    counts = {each.name: len(each) for each in made}
    if len({*counts.values()}) > 1:
        raise mismatch(file, "as many queries of each method", counts)
    return made


@dataclass(frozen=True, eq=False)
class FixFile:
    """The fixes of ``surefix run -o``: as matches, with the trust flags of the single matches.

    Attributes
    ----------
    matches : Matches
    single_place : array of int64, shape (m,)
    trusted : array of bool, shape (m,)
    queries : list of str
    times : list of float or None
    """

    matches: Matches
    single_place: npt.NDArray[np.int64]
    trusted: npt.NDArray[np.bool_]
    queries: list[str]
    times: list[float | None]


def read_fixes(path: Path) -> FixFile:
    """Reads the CSV or the JSON lines of ``surefix run -o``.

    Raises
    ------
    SurefixFileError
        If the file cannot be read.
    SurefixValueError
        For other columns or cells, or no fix.
    """
    if path.suffix.lower() in (".jsonl", ".ndjson", ".json"):
        numbers, cells = _json_lines(path)
    else:
        numbers, cells = _table(path, OF_RUN)
    one = _Reader(path, numbers, cells)
    place = one.wholes("place", 0)
    # Only a track is sure of a place, or that it is off the map.
    said = {
        name: one.floats(name) for name in ("confidence", "off_map") if any(cells.get(name, ()))
    }
    accepted = one.flags("accepted") if "accepted" in cells else None
    matches = Matches(
        place, one.scores(), one.flags("ready") | ("confidence" in said), accepted, **said
    )
    times = [float(cell) if cell else None for cell in cells.get("time", ())]
    single = one.wholes("single_place", 0)
    return FixFile(matches, single, one.flags("trusted"), cells["query"], times)


def chosen(reports: Mapping[str, Sequence[Judged]], methods: Sequence[str]) -> list[Judged]:
    """The methods to compare, of reports by their labels; see ``surefix.compare``.

    Raises
    ------
    SurefixValueError
        If a report lacks a method, or several have none in common.
    """
    known = {name: {each.name: each for each in found} for name, found in reports.items()}
    # Fixes are of one method, without a name.
    free = {name for name, found in known.items() if [*found] == [""]}
    named = [found for name, found in known.items() if name not in free]
    if not methods and named:
        shared = [name for name in named[0] if all(name in other for other in named)]
        if not shared:
            raise mismatch("methods", "one that all reports have", f"none: {_listed(known)}")
        usual = WEIGHTED if WEIGHTED in shared else shared[0]
        methods = shared if len(known) == 1 else [usual]
    picked = []
    for source, found in known.items():
        for method in [""] if source in free else methods:
            if method not in found:
                raise mismatch(f"{source}, method", f"one of {', '.join(found)}", repr(method))
            parts = [source] if len(known) > 1 else []
            parts += [method] if method and (len(methods) > 1 or not parts) else []
            picked.append(replace(found[method], name=": ".join(parts)))
    return picked


def drive_of(files: Sequence[str]) -> str | None:
    """A drive's mark, a whole number: of the names and sizes of its files, and of bytes in the
    middle of a few. None without files, or if one cannot be read.
    """
    found = hashlib.sha256()
    some = {k * (len(files) - 1) // (LOOKED_AT - 1) for k in range(LOOKED_AT)}
    try:
        for index, file in enumerate(map(Path, files)):
            size = file.stat().st_size
            # Names of files are bytes.
            found.update(f"{file.name}\0{size}\n".encode(errors="surrogateescape"))
            if index in some:
                with file.open("rb") as opened:
                    opened.seek(max(0, (size - BYTES) // 2))
                    found.update(opened.read(BYTES))
    except OSError:
        return None
    return str(int(found.hexdigest()[:12], 16)) if files else None


def labels(paths: Sequence[str | Path]) -> list[str]:
    """Short names of folders and files that all differ: stems, else names, else the whole paths."""
    each = [Path(path) for path in paths]
    stems = [path.name if path.is_dir() else path.stem for path in each]
    for names in (stems, [path.name for path in each]):
        if all(names) and len({*names}) == len(names):
            return names
    return [*map(str, paths)]


def _listed(known: Mapping[str, Mapping[str, Judged]]) -> str:
    return "; ".join(f"{source} has {', '.join(found)}" for source, found in known.items())


def _table(path: Path, expected: Sequence[str]) -> tuple[list[int], Cells]:
    """The number of each row, and the cells of each column, of which some are expected."""
    lines = list(_lines(path))
    header = lines[0][1] if lines else []
    lacking = [name for name in expected if name not in header]
    if lacking:
        got = f"{', '.join(header)[:200] or 'an empty file'}, without {', '.join(lacking)}"
        raise mismatch(f"{path}, row 1", f"the columns {', '.join(expected)}", got)
    if len(lines) < 2:
        raise mismatch(path, "a row for each query", "none")
    for number, line in lines[1:]:
        if len(line) != len(header):
            raise mismatch(f"{path}, row {number}", f"{len(header)} cells", len(line))
    columns = zip(*(line for _, line in lines[1:]), strict=True)
    cells = {name: [*column] for name, column in zip(header, columns, strict=True)}
    return [number for number, _ in lines[1:]], cells


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """The number of each row and its cells; a name of a file may have a line's end in it."""
    reader = csv.reader(io.StringIO(read_text(path, "the fixes"), newline=""))
    try:
        for cells in reader:
            if any(cells):
                yield reader.line_num, [cell.strip() for cell in cells]
    except csv.Error as error:
        where = f"{path}, row {reader.line_num}"
        raise mismatch(where, "values with commas between", error) from None


def _json_lines(path: Path) -> tuple[list[int], Cells]:
    """The same of a JSON object a line."""
    found: list[tuple[int, dict[str, Any]]] = []
    for number, line in enumerate(read_text(path, "the fixes").splitlines(), 1):
        if not line.strip():
            continue
        try:
            row = json.loads(line)
        except (ValueError, RecursionError) as error:
            raise mismatch(f"{path}, row {number}", "a JSON object a line", error) from None
        if not isinstance(row, dict) or {*OF_RUN} - {*row}:
            raise mismatch(
                f"{path}, row {number}", f"an object with {', '.join(OF_RUN)}", line[:80]
            )
        found.append((number, row))
    if not found:
        raise mismatch(path, "a row for each query", "none")
    cells: Cells = {}
    for name in found[0][1]:
        values = [row.get(name) for _, row in found]
        cells[name] = [
            str(v).lower() if isinstance(v, bool) else "" if v is None else str(v) for v in values
        ]
    return [number for number, _ in found], cells


@dataclass(frozen=True, eq=False)
class _Reader:
    """Columns as numbers and flags; a cell that is none is refused with its row."""

    path: Path
    numbers: Sequence[int]
    cells: Cells

    def taken(self, which: npt.NDArray[np.int64]) -> "_Reader":
        cells = {name: [column[k] for k in which] for name, column in self.cells.items()}
        return _Reader(self.path, [self.numbers[k] for k in which], cells)

    def _each(self, name: str, convert: Callable[[str, int], T]) -> list[T]:
        return [
            convert(cell, row) for cell, row in zip(self.cells[name], self.numbers, strict=True)
        ]

    def floats(self, name: str, finite: bool = True) -> npt.NDArray[np.float64]:
        values = self._each(
            name, lambda cell, row: decimal(cell, self.path, row, name, finite=finite)
        )
        return np.array(values, np.float64)

    def wholes(self, name: str, least: int = -1) -> npt.NDArray[np.int64]:
        def convert(cell: str, row: int) -> int:
            value = whole(cell, self.path, row, name)
            if value < least:
                raise mismatch(f"{self.path}, row {row}", f"{name}, {least} or more", value)
            return value

        return np.array(self._each(name, convert), np.int64)

    def scores(self) -> npt.NDArray[np.float32]:
        """The scores; of a query with a match it is finite."""
        values = self.floats("score", finite=False)
        wrong = np.flatnonzero(~np.isfinite(values) & self.flags("ready"))
        if len(wrong):
            where = f"{self.path}, row {self.numbers[wrong[0]]}"
            raise mismatch(where, "a finite score", values[wrong[0]])
        return values.astype(np.float32)

    def flags(self, name: str) -> npt.NDArray[np.bool_]:
        def convert(cell: str, row: int) -> bool:
            if cell not in ("true", "false", ""):
                raise SurefixValueError(
                    f"{self.path}, row {row}: expected {name}, true or false, got {cell!r}"
                )
            return cell == "true"

        return np.array(self._each(name, convert), bool)
