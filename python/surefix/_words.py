"""Counts and places in sentences."""

import shutil
from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from surefix import Segments


def plural(count: int, one: str, more: str = "") -> str:
    """The count with its noun, ``1 fix``, ``2 fixes``; by default the plural takes an s."""
    return f"{count} {one if count == 1 else more or one + 's'}"


def verb(count: int) -> str:
    """The verb after a count."""
    return "is" if count == 1 else "are"


def fitted(text: str, stream: TextIO) -> str:
    """The text for a stream: on a terminal its lines are broken between words, names of files stay
    whole.
    """
    if not stream.isatty():
        return text
    how: Any = {"break_long_words": False, "break_on_hyphens": False}
    wide = shutil.get_terminal_size().columns
    return "\n".join(fill(line, wide, **how) for line in text.splitlines())


def columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """The lines of a table in plain columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    padded = ([c.ljust(w) for c, w in zip(row, widths, strict=True)] for row in rows)
    return ["  ".join(cells).rstrip() for cells in padded]


def place_in(segments: "Segments | None", place: int) -> str:
    """A place: of several segments, the segment and the place counted from its start."""
    if segments is None or len(segments) == 1:
        return f"place {place}"
    index = segments.index_of(place)
    return f"segment {index}, place {place - segments[index].start}"
