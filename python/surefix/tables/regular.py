"""Files to be read: regular ones, in no more memory than there is."""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from surefix.errors import SurefixError, SurefixFileError, refusal
from surefix.machine import room_for

KINDS = ((stat.S_ISFIFO, "a pipe"), (stat.S_ISSOCK, "a socket"), (stat.S_ISDIR, "a folder"))
# Bytes of memory a byte of text, about: its cells are objects of Python.
OF_TEXT = 16
# Below this, the system is not asked how much memory is free.
SMALL = 16 << 20


def check_regular(path: str | os.PathLike[str], problem: str, *, folder: bool = False) -> int:
    """The length of a file that can be read to its end; ``problem`` is ``cannot read the truth``.

    With ``folder``, a folder will do.

    Raises
    ------
    SurefixFileError
        For a pipe, a device or a socket, which may never end, and if there is no such file.
    """
    try:
        # Not opened: a pipe would wait for its other end.
        about = os.stat(path)
    except (OSError, ValueError) as error:
        # A NUL in the name is a ValueError.
        if isinstance(error, OSError):
            raise refusal(path, problem, error) from None
        raise SurefixFileError(f"{os.fspath(path)!r}: {problem}: {error}") from None
    if stat.S_ISREG(about.st_mode) or (folder and stat.S_ISDIR(about.st_mode)):
        return about.st_size
    kind = next((name for fits, name in KINDS if fits(about.st_mode)), "a device")
    raise SurefixFileError(f"{path}: {problem}: expected a file, got {kind}")


def check_room(size: int, what: object) -> None:
    """Refuses to read what takes more memory than there is."""
    if size > SMALL:
        room_for(size, str(what))


@contextmanager
def within_memory(what: object) -> Iterator[None]:
    """The end of memory is an error of surefix, which says of which file."""
    try:
        yield
    except MemoryError as error:
        said = str(error) or "there is not enough"
        raise SurefixError(f"{what}: memory: {said[0].lower()}{said[1:]}") from None


def read_bytes(path: Path, problem: str, each: int = 1) -> bytes:
    """A whole file; ``each`` is how many bytes of memory a byte of it takes, in the end.

    Raises
    ------
    SurefixFileError
        As for ``check_regular``, and if it cannot be read.
    SurefixError
        If there is not the memory for it.
    """
    check_room(each * check_regular(path, problem), path)
    try:
        with within_memory(path):
            return path.read_bytes()
    except OSError as error:
        raise refusal(path, problem, error) from None
