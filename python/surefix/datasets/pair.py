"""Two traverses of one route with a truth, and the origin of a data set."""

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
import numpy.typing as npt

from surefix.errors import SurefixFileError, SurefixValueError, mismatch
from surefix.frames.images import Images


@dataclass(frozen=True)
class Origin:
    """A data set's title, source and licence, one line each; ``signs`` are patterns that tell its
    folder.

    Examples
    --------
    >>> from surefix.datasets import Origin
    >>> origin = Origin("Corridor", "https://example.org", "CC BY 4.0")
    >>> origin.folder("/nowhere", "the images")                      # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    surefix.errors.SurefixFileError: /nowhere: no such folder (the images). Corridor: https:...
    """

    title: str
    source: str
    licence: str
    signs: tuple[str, ...] = ()

    def folder(self, path: str | PathLike[str], purpose: str) -> Path:
        """The folder; a SurefixFileError with its purpose and source if it is missing."""
        if not Path(path).is_dir():
            raise self.missing(Path(path), "no such folder", purpose)
        return Path(path)

    def file(self, path: str | PathLike[str], purpose: str) -> Path:
        """The file; a SurefixFileError with its purpose and source if it is missing."""
        if not Path(path).is_file():
            raise self.missing(Path(path), "no such file", purpose)
        return Path(path)

    def missing(self, path: Path, problem: str, purpose: str) -> SurefixFileError:
        """The error that names a missing file or folder."""
        return SurefixFileError(
            f"{path}: {problem} ({purpose}). {self.title}: {self.source}. Licence: {self.licence}"
        )


@dataclass(frozen=True, eq=False, repr=False)
class Pair:
    """Two traverses of one route: the map is made of the references, the queries are located on it.

    Attributes
    ----------
    name : str
        For a title or a table: the data set and its two traverses.
    references, queries : Images
        In route order, loaded lazily.
    truth : array of int64, shape (m,), or None
        For each query the reference that shows its place; -1 if none does. None if unknown.
    reference_positions, query_positions : array of float64, shape (n, 2 or 3), (m, 2 or 3), or None
        In planar metres, both on one plane.
    source, licence : str
        Where to obtain the data set, and its terms.
    notes : tuple of str
        The images that the loader left out, for a report.

    Raises
    ------
    SurefixValueError
        If the lengths do not agree, or a truth is not the index of a reference.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.datasets import ImageArray, Pair
    >>> route = ImageArray(np.zeros((4, 8, 8), np.uint8))
    >>> Pair("standing still", route, route[:2], truth=np.array([0, -1]))
    Pair('standing still': 4 references, 2 queries, 1 with a true place)
    """

    name: str
    references: Images
    queries: Images
    truth: npt.NDArray[np.int64] | None = None
    reference_positions: npt.NDArray[np.float64] | None = None
    query_positions: npt.NDArray[np.float64] | None = None
    source: str = ""
    licence: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n, m = len(self.references), len(self.queries)
        for what, positions, count in (
            ("reference", self.reference_positions, n),
            ("query", self.query_positions, m),
        ):
            if positions is not None and positions.shape not in ((count, 2), (count, 3)):
                expected = f"{what} positions ({count}, 2) or ({count}, 3), one an image"
                raise mismatch(self.name, expected, positions.shape)
        if self.truth is None:
            return
        if self.truth.shape != (m,):
            raise mismatch(self.name, f"a truth for each of the {m} queries", self.truth.shape)
        wrong = np.flatnonzero((self.truth < -1) | (self.truth >= n))
        if len(wrong):
            expected = f"the index of one of the {n} references, or -1 for none"
            got = f"{self.truth[wrong[0]]} for query {wrong[0]}"
            raise mismatch(self.name, expected, got)

    def __repr__(self) -> str:
        known = "no truth"
        if self.truth is not None:
            known = f"{int((self.truth >= 0).sum())} with a true place"
        counts = f"{len(self.references)} references, {len(self.queries)} queries"
        return f"Pair({self.name!r}: {counts}, {known})"


def same_places(name: str, origin: Origin, references: Images, queries: Images) -> Pair:
    """Two traverses of which query ``i`` shows the place of reference ``i``."""
    if references.paths is not None and queries.paths is not None:
        check_same_names(name, references, queries)
    truth = identity(name, references, queries)
    return Pair(name, references, queries, truth, source=origin.source, licence=origin.licence)


def identity(name: str, references: Images, queries: Images) -> npt.NDArray[np.int64]:
    """The truth if query ``i`` shows the place of reference ``i``; both must have one length."""
    if len(references) != len(queries):
        where = f"{name}: query i shows the place of reference i, so"
        got = f"{len(queries)} queries and {len(references)} references"
        raise SurefixValueError(f"{where} expected one query a reference, got {got}")
    return np.arange(len(queries), dtype=np.int64)


def check_same_names(name: str, references: Images, queries: Images) -> None:
    """Refuses an image that only one traverse has: everything behind it would be off by one."""
    has, wanted = set(queries.names), set(references.names)
    for traverse, lacking in (("query", wanted - has), ("reference", has - wanted)):
        if lacking:
            got = f"{len(references)} references and {len(queries)} queries"
            wrong = f"the {traverse} traverse lacks {len(lacking)}, such as {min(lacking)}"
            raise mismatch(name, "the same image names in both traverses", f"{got}; {wrong}")
