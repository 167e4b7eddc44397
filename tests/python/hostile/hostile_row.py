"""A row of the table of hostile inputs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

# Classes of errors, as rows name them; a command ends with the code 1 or 2.
VALUE, FILE, ANY, COMMAND = "SurefixValueError", "SurefixFileError", "SurefixError", "SystemExit"


class Row(NamedTuple):
    """An input, the door that it is brought to, and the answer.

    ``make`` writes a file in a folder and gives its path; the door then opens it under the limits.
    ``error`` is the class of the error, or a base of it, and ``text`` a pattern in it; "" if the
    input is to be read. ``needs`` are the libraries without which there is nothing to test.
    """

    name: str
    door: Callable[[Path], object]
    make: Callable[[Path], Path]
    error: str
    text: str
    needs: tuple[str, ...] = ()
