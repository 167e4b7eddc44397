"""The paper's own numbers: its Table I, or those that a user gives."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from surefix.errors import mismatch
from surefix.tables.rows import rows

__all__ = ["PUBLISHED", "PaperRow", "read_paper"]

COLUMNS = ("dataset", "technique", "baseline", "weighted")


@dataclass(frozen=True)
class PaperRow:
    """A row of the paper's Table I; None for a missing number, ``also`` is another name of the data
    set.
    """

    dataset: str
    technique: str
    baseline: float | None
    weighted: float | None
    also: str = ""

    def is_for(self, technique: str, *datasets: str) -> bool:
        """Whether it is about this technique on one of these data sets, by letters and digits."""
        names = list(map(_plain, datasets))
        # A row of certain traverses is not for others of the data set.
        named = _plain(self.dataset) in (names[:1] if self.also else names)
        named |= bool(self.also) and _plain(self.also) in names
        return named and _plain(self.technique) == _plain(technique)


def _plain(name: str) -> str:
    return "".join(filter(str.isalnum, name.casefold()))


def _published() -> Iterator[PaperRow]:
    """Table I: the areas of SAD, NetVLAD and Patch-NetVLAD on each data set; ``also`` is the name
    that the case of these traverses has.
    """
    for dataset, also, *areas in (
        ("GardensPoint", "gardens_point, day_left to day_right",
         0.54, 0.68, 0.87, 0.87, 0.92, 0.94),
        ("Nordland-fs", "nordland, spring to fall", 0.88, 0.98, 0.62, 0.74, 0.95, 0.99),
        ("Nordland-sw", "nordland, winter to summer", 0.66, 0.89, 0.27, 0.35, 0.74, 0.74),
        ("4seasons", "four_seasons", 0.99, 0.96, 0.99, 0.98, 0.97, 0.98),
        ("RobotCar", "", 0.50, 0.82, 0.78, 0.81, 0.88, 0.92),
    ):  # fmt: skip
        for index, technique in enumerate(("SAD", "NetVLAD", "PatchNetVLAD")):
            baseline, weighted = areas[2 * index : 2 * index + 2]
            yield PaperRow(dataset, technique, baseline, weighted, also)


PUBLISHED = tuple(_published())


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
        baseline, weighted = (_area(cells[name], f"{here}, {name}") for name in COLUMNS[2:])
        row = PaperRow(cells["dataset"], cells["technique"], baseline, weighted)
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
