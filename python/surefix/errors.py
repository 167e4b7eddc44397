"""Errors. Each message names the place, the expected value and the value that it got."""

from pathlib import Path

from surefix._words import plain

# Characters of a value in a message.
LONGEST = 500


class SurefixError(Exception):
    """Every error of surefix. A call that raises one has left its object as it was.

    Its text is one line: of names in it, control characters are escaped.
    """

    def __str__(self) -> str:
        return plain(super().__str__())


class SurefixValueError(SurefixError, ValueError):
    """An option, an array, an image, a map or a snapshot is not what it must be."""


class SurefixFileError(SurefixError, OSError):
    """The operating system refused a file or a folder."""


def mismatch(where: object, expected: object, got: object) -> SurefixValueError:
    """The error of a value: where it is, the expected one, and the one that it got."""
    said = str(got)
    # A cell of a damaged file may be of any length.
    said = said if len(said) <= LONGEST else f"{said[:LONGEST]}..."
    return SurefixValueError(f"{where}: expected {expected}, got {said}")


def check_folder(file: Path, problem: str) -> None:
    """Refuses a file to write if its folder does not exist."""
    folder = file.absolute().parent
    if not folder.is_dir():
        raise SurefixFileError(f"{file}: {problem}: there is no folder {folder}")


def refusal(where: object, problem: str, error: OSError) -> SurefixFileError:
    """The error of the operating system: where, ``cannot read the image``, and why."""
    return SurefixFileError(f"{where}: {problem}: {error.strerror or error}")
