"""Tables in text files, read so that a malformed line is named by file and row."""

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from surefix.errors import SurefixFileError, SurefixValueError

__all__ = ["ascending", "decimal", "header_and_rows", "rows", "whole"]


def rows(path: Path, delimiter: str | None) -> Iterator[tuple[int, list[str]]]:
    """Each line's number, from 1, and its cells; without empty lines and those that begin with
    ``#``.

    Parameters
    ----------
    path : Path
    delimiter : str or None
        None for any white space.

    Raises
    ------
    SurefixFileError
        Where the file cannot be read.
    SurefixValueError
        Where it is not text.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise SurefixFileError(
            f"{path}: cannot read the table: {error.strerror or error}"
        ) from None
    except UnicodeDecodeError as error:
        raise SurefixValueError(
            f"{path}: expected a text file in UTF-8, got {error.reason}"
        ) from None
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            cells = (
                line.split() if delimiter is None else next(csv.reader([line], delimiter=delimiter))
            )
        except csv.Error as error:
            raise SurefixValueError(
                f"{path}, row {number}: expected values with commas between, got {error}"
            ) from None
        yield number, [cell.strip() for cell in cells]


def header_and_rows(path: Path, expected: str) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """The column names of a CSV, in lower case, and its rows, each with as many cells.

    Raises
    ------
    SurefixFileError
        Where the file cannot be read.
    SurefixValueError
        Where it has no header or no row, or a row has more or fewer cells.
    """
    numbered = list(rows(path, ","))
    if len(numbered) < 2:
        raise SurefixValueError(
            f"{path}: expected a header ({expected}) and rows, got {len(numbered)} lines"
        )
    header = [cell.lower() for cell in numbered[0][1]]
    for number, cells in numbered[1:]:
        if len(cells) != len(header):
            raise SurefixValueError(
                f"{path}, row {number}: expected {len(header)} values, got {len(cells)}"
            )
    return header, numbered[1:]


def whole(cell: str, path: Path, row: int, what: str) -> int:
    """An integer, at most 64 bits wide."""
    try:
        value = int(cell)
    except ValueError:
        value = 1 << 63
    if not -(1 << 63) <= value < 1 << 63:
        raise SurefixValueError(f"{path}, row {row}: expected {what}, a whole number, got {cell!r}")
    return value


def decimal(cell: str, path: Path, row: int, what: str, *, finite: bool = True) -> float:
    """A number, finite unless the file marks what it does not know by NaN."""
    try:
        value = float(cell)
    except ValueError:
        raise SurefixValueError(
            f"{path}, row {row}: expected {what}, a number, got {cell!r}"
        ) from None
    if finite and not np.isfinite(value):
        raise SurefixValueError(
            f"{path}, row {row}: expected {what}, a finite number, got {cell!r}"
        )
    return value


def ascending(stamps: Sequence[int], numbers: Sequence[int], path: Path) -> npt.NDArray[np.int64]:
    """The timestamps as an array, each later than the one before.

    Raises
    ------
    SurefixValueError
        Where two are equal or the later comes first: the error names the row.
    """
    array = np.array(stamps, dtype=np.int64)
    wrong = np.flatnonzero(array[1:] <= array[:-1])
    if len(wrong):
        at = int(wrong[0]) + 1
        problem = "twice" if array[at] == array[at - 1] else f"after {array[at - 1]}"
        raise SurefixValueError(
            f"{path}, row {numbers[at]}: expected ascending timestamps, got {array[at]} {problem}"
        )
    return array
