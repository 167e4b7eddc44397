"""An exhibit, a table or figure of the paper: rows for a CSV file, pictures, sentences."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from surefix.report.page import Picture, Section, Table
from surefix.reproduce.case import Case

__all__ = ["Cell", "Exhibit", "a_case", "in_parts", "listed", "shown", "stem"]

Cell = str | int | float | None

# More rows in one picture cannot be read.
ROWS_A_PICTURE = 8


@dataclass(frozen=True)
class Exhibit:
    """One table or figure of the paper, made again.

    Attributes
    ----------
    name : str
        The stem of its CSV file.
    title : str
    paragraphs : sequence of str
        Its meaning, with its numbers.
    header, rows
        The whole CSV file: an empty cell is None.
    pictures : mapping of a file's stem to a ``Picture``
    tables : sequence of ``Table``
        The numbers on the page.
    points : sequence of str
        A sentence a case.
    """

    name: str
    title: str
    paragraphs: Sequence[str]
    header: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    pictures: Mapping[str, Picture] = field(default_factory=dict)
    tables: Sequence[Table] = ()
    points: Sequence[str] = ()

    @property
    def section(self) -> Section:
        """On the page."""
        pictures = tuple(self.pictures.values())
        return Section(
            self.title, self.paragraphs, pictures, tables=self.tables, points=self.points
        )


def a_case(name: str, pictures: Mapping[Case, Picture]) -> dict[str, Picture]:
    """A picture for each case, by the stems of their files."""
    return {stem(name, case.dataset, case.technique): picture for case, picture in pictures.items()}


def in_parts(
    name: str, cases: Sequence[Case], picture: Callable[[Sequence[Case]], Picture]
) -> dict[str, Picture]:
    """A picture for every eight cases, by the stems of their files."""
    starts = range(0, len(cases), ROWS_A_PICTURE)
    return {
        f"{name}_{number}" if number > 1 else name: picture(cases[start:][:ROWS_A_PICTURE])
        for number, start in enumerate(starts, 1)
    }


def shown(value: float | None, digits: int = 3) -> str:
    """A number for the page, or a dash for none."""
    return "\u2013" if value is None else f"{value:.{digits}f}"


def listed(parts: Sequence[str]) -> str:
    """Parts of a sentence: a; b; and c."""
    if len(parts) < 2:
        return parts[0] if parts else "none"
    return f"{'; '.join(parts[:-1])}; and {parts[-1]}"


def stem(*parts: str) -> str:
    """A file's name without its ending, of letters that every system takes."""
    return "_".join(re.sub(r"[^a-z0-9]+", "_", part.lower()).strip("_") for part in parts)
