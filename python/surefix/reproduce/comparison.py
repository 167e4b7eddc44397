"""A comparison as it is written down: a table as CSV, pictures, and sentences."""

import csv
import io
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from matplotlib.axes import Axes

# Pillow comes with matplotlib.
from PIL import Image

from surefix.plot.theme import DARK, Theme, png
from surefix.report.page import Picture, Table

__all__ = ["Cell", "Comparison", "csv_text", "drawn", "listed", "shown", "stem"]

Cell = str | int | float | None


@dataclass(frozen=True)
class Comparison:
    """One table or figure of the paper, made again.

    Attributes
    ----------
    name : str
        The stem of its CSV file.
    title : str
    paragraphs : sequence of str
        What it shows, from its numbers.
    header, rows
        What the CSV holds, whole: a row's empty cell is None.
    pictures : mapping of a file's stem to a ``Picture``
    tables : sequence of ``Table``
        What the page shows in numbers.
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


def drawn(
    draw: Callable[[Axes, Theme], object],
    alt: str,
    caption: str = "",
    size: tuple[float, float] = (6.4, 4.9),
) -> Picture:
    """A picture on light and on dark paper; one of more than 8 inches takes the page's whole
    width.
    """
    return Picture(
        _small(png(draw, size)), _small(png(draw, size, DARK)), alt, caption, wide=size[0] > 8
    )


def _small(picture: bytes) -> bytes:
    """The picture in few colours, at a third of the bytes: a report of many cases has a hundred of
    them.
    """
    file = io.BytesIO()
    image = Image.open(io.BytesIO(picture)).convert("RGB").quantize(128, dither=Image.Dither.NONE)
    image.save(file, "PNG", optimize=True)
    return file.getvalue()


def csv_text(header: Sequence[str], rows: Sequence[Sequence[Cell]]) -> str:
    """A table as CSV. Numbers keep all their digits."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(["" if cell is None else cell for cell in row] for row in rows)
    return file.getvalue()


def shown(value: float | None, digits: int = 3) -> str:
    """A number for the page, or a dash where there is none."""
    return "\u2013" if value is None else f"{value:.{digits}f}"


def listed(parts: Sequence[str]) -> str:
    """Parts of a sentence: a, b and c."""
    return (
        parts[0]
        if len(parts) == 1
        else f"{'; '.join(parts[:-1])}; and {parts[-1]}"
        if parts
        else "none"
    )


def stem(*parts: str) -> str:
    """A file's name without its ending, of letters that every system takes."""
    return "_".join(re.sub(r"[^a-z0-9]+", "_", part.lower()).strip("_") for part in parts)
