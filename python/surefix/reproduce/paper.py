"""The paper's own numbers, as a user gives them: surefix has none."""

from dataclasses import dataclass
from pathlib import Path

from surefix.errors import mismatch
from surefix.tables.rows import rows

__all__ = ["PaperRow", "read_paper"]

COLUMNS = ("dataset", "technique", "baseline", "weighted")


@dataclass(frozen=True)
class PaperRow:
    """A row of the paper's Table I; None for a missing number."""

    dataset: str
    technique: str
    baseline: float | None
    weighted: float | None

    def is_for(self, technique: str, *datasets: str) -> bool:
        """Whether it is about this technique on one of these data sets, small or large letters."""
        named = self.dataset.casefold() in map(str.casefold, datasets)
        return named and self.technique.casefold() == technique.casefold()


def read_paper(path: Path) -> list[PaperRow]:
    """Reads a CSV with the columns dataset, technique, baseline, weighted.

    Raises
    ------
    SurefixFileError
        If it cannot be read.
    SurefixValueError
        For other columns, text that is no number, or a number outside 0 to 1.
    """
    lines = list(rows(path, ",", "the paper's numbers"))
    header = [name.lower() for name in lines[0][1]] if lines else []
    if set(COLUMNS) - set(header):
        raise mismatch(f"{path}, row 1", f"the columns {','.join(COLUMNS)}", ",".join(header))
    found: list[PaperRow] = []
    for number, line in lines[1:]:
        if not any(line):
            continue
        here = f"{path}, row {number}"
        if len(line) != len(header):
            raise mismatch(here, f"{len(header)} cells", len(line))
        cells = dict(zip(header, line, strict=True))
        areas = [_area(cells[name], f"{here}, {name}") for name in ("baseline", "weighted")]
        row = PaperRow(cells["dataset"], cells["technique"], *areas)
        if any(row.is_for(other.technique, other.dataset) for other in found):
            raise mismatch(here, "each case once", f"{row.dataset}, {row.technique} twice")
        found.append(row)
    return found


def _area(text: str, where: str) -> float | None:
    if not text:
        return None
    try:
        area = float(text)
    except ValueError:
        area = -1.0
    if not 0 <= area <= 1:
        raise mismatch(where, "an area from 0 to 1, or nothing", repr(text))
    return area
