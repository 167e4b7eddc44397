"""What every loader gives: two traverses of one route, and which place each query shows."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from surefix.datasets.images import Images
from surefix.errors import SurefixValueError

__all__ = ["Pair", "check_same_names", "identity"]


@dataclass(frozen=True, eq=False, repr=False)
class Pair:
    """Two traverses of one route: the map is made of the references, the queries are located on it.

    Attributes ---------- name : str For a title or a table: the data set and its two traverses.
    references, queries : Images In route order, loaded lazily. truth : array of int64, shape (m,),
    or None For each query the reference that shows its place; -1 where none does. None where
    nothing is known. reference_positions, query_positions : array of float64, shape (n, 2 or 3) and
    (m, 2 or 3), or None In planar metres, both on one plane. source, licence : str Where to obtain
    the data set, and its terms. notes : tuple of str What the loader left out, for a report to say.

    Raises
    ------
    SurefixValueError
        Where the lengths do not agree, or a truth is not the index of a reference.

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
        for what, positions, images in (
            ("reference", self.reference_positions, self.references),
            ("query", self.query_positions, self.queries),
        ):
            if positions is not None and (
                positions.ndim != 2
                or positions.shape[1] not in (2, 3)
                or len(positions) != len(images)
            ):
                raise SurefixValueError(
                    f"{self.name}: expected {what} positions ({len(images)}, 2) or ({len(images)}, 3), one an image, "
                    f"got {positions.shape}"
                )
        if self.truth is None:
            return
        if self.truth.shape != (len(self.queries),):
            raise SurefixValueError(
                f"{self.name}: expected a truth for each of the {len(self.queries)} queries, got {self.truth.shape}"
            )
        wrong = np.flatnonzero((self.truth < -1) | (self.truth >= len(self.references)))
        if len(wrong):
            raise SurefixValueError(
                f"{self.name}: expected the index of one of the {len(self.references)} references, or -1 for none, "
                f"got {self.truth[wrong[0]]} for query {wrong[0]}"
            )

    def __repr__(self) -> str:
        known = (
            "no truth"
            if self.truth is None
            else f"{int((self.truth >= 0).sum())} with a true place"
        )
        return f"Pair({self.name!r}: {len(self.references)} references, {len(self.queries)} queries, {known})"


def identity(name: str, references: Images, queries: Images) -> npt.NDArray[np.int64]:
    """The truth where query ``i`` shows the place of reference ``i``.

    Raises
    ------
    SurefixValueError
        Where there are not as many of one as of the other.
    """
    if len(references) != len(queries):
        raise SurefixValueError(
            f"{name}: query i shows the place of reference i, so expected as many queries as references, "
            f"got {len(queries)} queries and {len(references)} references"
        )
    return np.arange(len(queries), dtype=np.int64)


def check_same_names(name: str, references: Images, queries: Images) -> None:
    """Where the file's name is the place, both traverses must have the same.

    Raises
    ------
    SurefixValueError
        Where an image is in one traverse only: everything behind it would be off by one.
    """
    has, wanted = set(queries.names), set(references.names)
    for traverse, lacking in (("query", wanted - has), ("reference", has - wanted)):
        if lacking:
            raise SurefixValueError(
                f"{name}: expected the same image names in both traverses, got {len(references)} references and "
                f"{len(queries)} queries; the {traverse} traverse lacks {len(lacking)}, such as {min(lacking)}"
            )
