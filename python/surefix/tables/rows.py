"""Tables in text files. Errors name the file and the row."""

import codecs
import csv
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from surefix.errors import mismatch
from surefix.tables.regular import OF_TEXT, read_bytes

DECIMAL_COMMA = re.compile(r"^([-+]?\d+),(\d+)$")
# Cells of a value that is not known.
UNKNOWN = frozenset({"", "nan", "na", "n/a", "none", "null", "<na>"})


def read_text(path: Path, what: str = "the table") -> str:
    """A text file in UTF-8; ``what`` names it in an error."""
    try:
        content = read_bytes(path, f"cannot read {what}", OF_TEXT)
        # Excel's "Unicode text" is UTF-16, with a mark in front.
        wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        return content.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        raise mismatch(path, "a text file in UTF-8", error.reason) from None


def rows(
    path: Path, delimiter: str | None, what: str = "the table"
) -> Iterator[tuple[int, list[str]]]:
    """The number of each line, from 1, and its cells, without empty lines and ``#`` comments.

    A ``delimiter`` of None is any white space.
    """
    for number, line in enumerate(read_text(path, what).splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            cells = next(csv.reader([line], delimiter=delimiter)) if delimiter else line.split()
        except csv.Error as error:
            raise mismatch(f"{path}, row {number}", "values with commas between", error) from None
        yield number, [cell.strip() for cell in cells]


def cells_of(path: Path, what: str = "the table") -> list[tuple[int, list[str]]]:
    """As ``rows``, of a table whose cells are separated by semicolons, tabs, commas or white space,
    as the first row shows. A comment that is followed by rows of as many cells is their header.

    Beside semicolons and tabs, ``3,5`` is a number with a decimal comma.
    """
    text = read_text(path, what)
    lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), start=1)]
    kept = [(number, line) for number, line in lines if line and not line.startswith("#")]
    if not kept:
        return []
    delimiter = next((mark for mark in ";\t," if mark in kept[0][1]), None)
    # The stripped line lacks the empty cell at its end, which a tab would have ended.
    if delimiter == "\t":
        raw = dict(enumerate(text.splitlines(), start=1))
        kept = [(number, raw[number]) for number, _ in kept]

    def split(line: str) -> list[str]:
        try:
            cells = next(csv.reader([line], delimiter=delimiter)) if delimiter else line.split()
        except csv.Error as error:
            raise mismatch(path, "rows of cells", error) from None
        cells = [cell.strip() for cell in cells]
        if delimiter in (";", "\t"):
            cells = [DECIMAL_COMMA.sub(r"\1.\2", cell) for cell in cells]
        return cells

    table = [(number, split(line)) for number, line in kept]
    first = kept[0][0]
    comments = [(n, line) for n, line in lines if n < first and line.startswith("#")]
    for number, line in reversed(comments):
        cells = split(line.lstrip("# "))
        if len(cells) == len(table[0][1]) and not any(is_number(cell) for cell in cells):
            return [(number, cells), *table]
    return table


def is_number(cell: str) -> bool:
    """Whether a cell is a number, NaN and infinities among them."""
    try:
        float(cell)
    except ValueError:
        return False
    return True


def header_and_rows(path: Path, expected: str) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """The column names of a CSV, in lower case, and its rows, all of that length."""
    numbered = list(rows(path, ","))
    if len(numbered) < 2:
        raise mismatch(path, f"a header ({expected}) and rows", f"{len(numbered)} lines")
    header = [cell.lower() for cell in numbered[0][1]]
    for number, cells in numbered[1:]:
        if len(cells) != len(header):
            raise mismatch(f"{path}, row {number}", f"{len(header)} values", len(cells))
    return header, numbered[1:]


def columns(
    path: Path, choices: Sequence[Sequence[str]], expected: str
) -> tuple[Sequence[str], npt.NDArray[np.float64], list[int], Callable[[str], list[str] | None]]:
    """The first of some choices of columns that a CSV has: their names, their values, (rows,
    columns), the number of each row in the file, and a function that gives any column's cells.
    """
    header, numbered = header_and_rows(path, expected)
    names = next((names for names in choices if set(names) <= set(header)), None)
    if names is None:
        raise mismatch(f"{path}, row 1", f"the columns {expected}", ",".join(header))
    at = [(header.index(name), name) for name in names]
    values = [[decimal(cells[i], path, row, name) for i, name in at] for row, cells in numbered]

    def cells_of(name: str) -> list[str] | None:
        if name not in header:
            return None
        return [cells[header.index(name)] for _, cells in numbered]

    return names, np.array(values), [row for row, _ in numbered], cells_of


def whole(cell: str, path: Path, row: int, what: str) -> int:
    """An integer, at most 64 bits wide."""
    try:
        value = int(cell)
    except ValueError:
        value = 1 << 63
    if not -(1 << 63) <= value < 1 << 63:
        raise mismatch(f"{path}, row {row}", f"{what}, a whole number", repr(cell))
    return value


def decimal(cell: str, path: Path, row: int, what: str, *, finite: bool = True) -> float:
    """A number; with ``finite=False`` NaN and infinities too."""
    kind, value = "number", None
    try:
        value = float(cell)
        kind = "finite number"
    except ValueError:
        pass
    if value is None or (finite and not np.isfinite(value)):
        raise mismatch(f"{path}, row {row}", f"{what}, a {kind}", repr(cell))
    return value


def ascending(stamps: Sequence[int], numbers: Sequence[int], path: Path) -> npt.NDArray[np.int64]:
    """The timestamps of the rows of these numbers; each must be later than the one before."""
    array = np.array(stamps, dtype=np.int64)
    wrong = np.flatnonzero(array[1:] <= array[:-1])
    if len(wrong):
        at = int(wrong[0]) + 1
        problem = "twice" if array[at] == array[at - 1] else f"after {array[at - 1]}"
        got = f"{array[at]} {problem}"
        raise mismatch(f"{path}, row {numbers[at]}", "ascending timestamps", got)
    return array
