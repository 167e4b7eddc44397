"""What is written for a reader: names are text, whatever is in them, and no command to a terminal.

All that the commands write goes by ``say`` and ``Console``; only data has other ways.
"""

import shutil
import sys
from collections.abc import Iterable
from textwrap import fill
from typing import Any, TextIO

import rich.console
from rich.console import ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.text import Text

from surefix._words import plain

__all__ = ["Console", "fitted", "say"]


def say(*lines: object, file: TextIO | None = None, flush: bool = False) -> None:
    """Writes each as a line of its own, by default one empty line, to standard output."""
    text = "\n".join(plain(str(line)) for line in lines)
    print(text, file=sys.stdout if file is None else file, flush=flush)


def fitted(text: str, stream: TextIO) -> list[str]:
    """The lines of a text for a stream: on a terminal they are broken between words, names of files
    stay whole.
    """
    text = plain(text)
    if not stream.isatty():
        return [text]
    how: Any = {"break_long_words": False, "break_on_hyphens": False}
    return fill(text, shutil.get_terminal_size().columns, **how).split("\n")


class Console(rich.console.Console):  # noqa: TID251 (the only one)
    """A console on which a string is a line of plain text: no markup, and no control characters."""

    def __init__(self, **given: Any) -> None:
        super().__init__(markup=False, highlight=False, emoji=False, **given)

    def render_str(self, text: str, **given: Any) -> Text:
        return super().render_str(plain(text), **given)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        if isinstance(renderable, Text):
            # Lines of a drawing stay lines.
            text = "\n".join(map(plain, renderable.plain.split("\n")))
            if text != renderable.plain:
                renderable = Text(text, renderable.style)
        return super().render(renderable, options)
