"""An exhibit, a table or figure of the paper: rows for a CSV file, pictures, sentences."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from surefix.report.page import Picture, Section, drawn
from surefix.reproduce.case import Case

__all__ = ["Cell", "Exhibit", "listed", "pictured", "shown", "stem"]

Cell = str | int | float | None


@dataclass(frozen=True, kw_only=True)
class Exhibit(Section):
    """One table or figure of the paper, made again; its points are a sentence a case.

    Attributes
    ----------
    name : str
        The stem of its CSV file.
    header, rows
        The whole CSV file, its first line and its cells: an empty one is None.
    """

    name: str
    header: str
    rows: Sequence[Sequence[Cell]]


def pictured(
    name: str, case: Case, alt: str, draw: Any, *data: Any, **options: Any
) -> dict[str, Picture]:
    """A picture of one case, as by ``drawn``, by the name of its file."""
    file = f"{stem(name, case.dataset, case.technique)}.png"
    picture = drawn((6.4, 4.9), alt, draw, *data, caption=case.name, small=True, **options)
    return {file: picture}


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
