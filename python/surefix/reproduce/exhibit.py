"""An exhibit, a table or figure of the paper: rows for a CSV file, pictures, sentences."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes

from surefix.plot.theme import Theme
from surefix.report.multiples import multiples
from surefix.report.page import Picture, Section
from surefix.reproduce.case import Case

__all__ = ["Cell", "Exhibit", "listed", "pictured", "shown", "stem"]

Cell = str | int | float | None


@dataclass(frozen=True, kw_only=True)
class Exhibit(Section):
    """One table or figure of the paper, made again.

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
    name: str,
    cases: Sequence[Case],
    draw: Callable[[Axes, Case, Theme], object],
    said: Callable[[Case], str],
    x: str,
    y: str,
) -> dict[str, Picture]:
    """A picture with a panel for each case, by the name of its file; ``said`` is a case in words,
    for readers who cannot see it.
    """

    def panel(ax: Axes, index: int, theme: Theme) -> None:
        draw(ax, cases[index], theme)

    alt = " ".join(f"{case.name}: {said(case)}." for case in cases)
    return {f"{name}.png": multiples([case.name for case in cases], panel, alt, x=x, y=y)}


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
