"""The rows of a study in Parquet files: some at a time, each file whole, so that none is lost."""

import io
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from surefix._extra import require
from surefix._saving import save
from surefix.errors import SurefixError, mismatch, refusal

__all__ = ["Rows", "write_table"]

IDENTITY = "identity"
PROBLEM = "cannot write the results"
# A file has this many rows, or those of this many seconds.
MOST, SECONDS = 256, 10.0

Row = dict[str, Any]


def _parquet() -> Any:
    return require("pyarrow.parquet", "a study", "PyArrow", "surefix[study]")


class Rows:
    """The rows in a folder, by their identities; those that are added are there after ``flush``."""

    def __init__(self, folder: Path) -> None:
        self._parquet, self.folder = _parquet(), folder
        self._new: list[Row] = []
        self._since = time.monotonic()
        self.known: dict[str, Row] = {}
        for file in sorted(folder.glob("*.parquet")):
            try:
                found = self._parquet.read_table(file).to_pylist()
                self.known |= {row.pop(IDENTITY): row for row in found}
            except OSError as error:
                raise refusal(file, "cannot read the results", error) from None
            except (KeyError, ValueError) as error:
                problem = f"another kind of file, or a damaged one ({str(error).splitlines()[0]})"
                raise mismatch(file, "rows of a study", f"{problem}; delete it") from None

    def add(self, identity: str, row: Row) -> None:
        """One more; it is written with others."""
        self.known[identity] = row
        self._new.append({IDENTITY: identity, **row})
        if len(self._new) >= MOST or time.monotonic() - self._since > SECONDS:
            self.flush()

    def flush(self) -> None:
        """Writes those that were added."""
        rows, self._new, self._since = self._new, [], time.monotonic()
        if rows:
            write_table(self.folder / f"{rows[0][IDENTITY]}.parquet", rows)


def write_table(path: Path, rows: Sequence[Row], types: Mapping[str, str] | None = None) -> None:
    """Rows with the same columns as a Parquet file; ``types`` are those of the columns, as Arrow
    calls them, by default as the values are.

    Raises
    ------
    SurefixFileError
        If it cannot be written; an older one is then as it was.
    """
    import pyarrow

    fields = [(name, pyarrow.type_for_alias(kind)) for name, kind in (types or {}).items()]
    try:
        table = pyarrow.Table.from_pylist([*rows], pyarrow.schema(fields) if fields else None)
    except pyarrow.ArrowException as error:
        raise SurefixError(f"{path}: {PROBLEM}: {error}") from None
    file = io.BytesIO()
    _parquet().write_table(table, file)
    save(path, file.getvalue(), PROBLEM)
