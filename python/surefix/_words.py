"""Counts and places in sentences."""

import re
from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from surefix import Segments

# What a terminal takes as a command, or shows in another order: control characters, the ends of
# lines and the directions of Unicode, and bytes in a file's name that are no text.
COMMANDS = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def plain(text: str) -> str:
    """The text with those characters escaped, as ``repr`` has them: so does ``src/plain.rs``."""
    return COMMANDS.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def escaped(text: str) -> str:
    """The same as text of HTML or an attribute of it."""
    return escape(plain(text))


def plural(count: int, one: str, more: str = "") -> str:
    """The count with its noun, ``1 fix``, ``2 fixes``; by default the plural takes an s."""
    return f"{count} {one if count == 1 else more or one + 's'}"


def verb(count: int) -> str:
    """The verb after a count."""
    return "is" if count == 1 else "are"


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
