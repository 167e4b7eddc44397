"""Rows of CSV, for programs or for a spreadsheet."""

import csv
from collections.abc import Callable, Iterable
from typing import Any

__all__ = ["row_writer"]

# What begins a formula, or a command, in a spreadsheet.
FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")


def row_writer(file: Any, spreadsheet: bool = False) -> Callable[[Iterable[object]], object]:
    """A function that writes a row to an open file, None as an empty cell.

    As CSV for programs, all text is as it is, and reads back the same. For a ``spreadsheet``, text
    that would be a formula there, such as the name ``=1+1.png``, gets a ``'`` before it, which
    makes it text. Numbers are numbers in both.
    """
    write = csv.writer(file, lineterminator="\n").writerow
    return (lambda row: write(map(_as_text, row))) if spreadsheet else write


def _as_text(cell: object) -> object:
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULA) else cell
