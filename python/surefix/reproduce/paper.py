"""The paper's own numbers, as a user gives them: surefix has none."""

import csv
from dataclasses import dataclass
from pathlib import Path

from surefix.errors import SurefixValueError, refusal

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
        """Whether it is about this technique on a data set of these names, whatever the case of the
        letters.
        """
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
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines = [[cell.strip() for cell in line] for line in csv.reader(file)]
    except OSError as error:
        raise refusal(path, "cannot read the paper's numbers", error) from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise SurefixValueError(f"{path}: expected a CSV file in UTF-8, got {error}") from None
    header = [name.lower() for name in lines[0]] if lines else []
    if set(COLUMNS) - set(header):
        raise SurefixValueError(
            f"{path}, row 1: expected the columns {','.join(COLUMNS)}, got {','.join(header)}"
        )
    rows: list[PaperRow] = []
    for number, line in enumerate(lines[1:], 2):
        if not any(line):
            continue
        here = f"{path}, row {number}"
        if len(line) != len(header):
            raise SurefixValueError(f"{here}: expected {len(header)} cells, got {len(line)}")
        cells = dict(zip(header, line, strict=True))
        areas = [_area(cells[name], f"{here}, {name}") for name in ("baseline", "weighted")]
        row = PaperRow(cells["dataset"], cells["technique"], *areas)
        if any(row.is_for(other.technique, other.dataset) for other in rows):
            name = f"{row.dataset}, {row.technique}"
            raise SurefixValueError(f"{here}: expected each case once, got {name} twice")
        rows.append(row)
    return rows


def _area(text: str, where: str) -> float | None:
    if not text:
        return None
    try:
        area = float(text)
    except ValueError:
        area = -1.0
    if not 0 <= area <= 1:
        raise SurefixValueError(f"{where}: expected an area from 0 to 1, or nothing, got {text!r}")
    return area
