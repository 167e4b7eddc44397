"""Where a data set comes from, so that a missing file can be named together with where to obtain
it.
"""

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from surefix.errors import SurefixFileError

__all__ = ["Origin"]


@dataclass(frozen=True)
class Origin:
    """A data set's title, where to obtain it, and under what licence: one line each.

    Examples
    --------
    >>> from surefix.datasets import Origin
    >>> Origin("Corridor", "https://example.org", "CC BY 4.0").folder("/nowhere", "the reference images")
    Traceback (most recent call last):
        ...
    surefix.errors.SurefixFileError: /nowhere: no such folder (the reference images). Corridor: https://example.org. \
    Licence: CC BY 4.0
    """

    title: str
    source: str
    licence: str

    def folder(self, path: str | PathLike[str], purpose: str) -> Path:
        """The folder, which must be there.

        Raises
        ------
        SurefixFileError
            Where it is not: names the folder, what it is for, and where to obtain the data set.
        """
        path = Path(path)
        if not path.is_dir():
            raise self.missing(path, "no such folder", purpose)
        return path

    def file(self, path: str | PathLike[str], purpose: str) -> Path:
        """The file, which must be there.

        Raises
        ------
        SurefixFileError
            Where it is not: names the file, what it is for, and where to obtain the data set.
        """
        path = Path(path)
        if not path.is_file():
            raise self.missing(path, "no such file", purpose)
        return path

    def missing(self, path: Path, problem: str, purpose: str) -> SurefixFileError:
        """The error that names a missing file or folder."""
        return SurefixFileError(
            f"{path}: {problem} ({purpose}). {self.title}: {self.source}. Licence: {self.licence}"
        )
