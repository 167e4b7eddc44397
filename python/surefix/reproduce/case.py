"""A case: the distances of one technique on one data set, with the truth, and how all cases are
treated.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from surefix._core import Evaluation, Trust, evaluate, evaluate_trust, match_distances
from surefix.baselines import perfect_predictor, plain_sequence, weighted_sequence
from surefix.baselines.distances import Distances, Flags
from surefix.baselines.truth import Truth
from surefix.errors import SurefixValueError
from surefix.matches import Matches

__all__ = ["UPTO", "WEIGHT", "Case", "Recall", "Settings"]

# The paper's weight, and the recall up to which it takes the area.
WEIGHT = 0.99
UPTO = 0.2

Recall = Literal["correct", "place_exists", "rejected"]


@dataclass(frozen=True)
class Settings:
    """What holds for every comparison.

    Parameters
    ----------
    recall : {"correct", "place_exists", "rejected"}
        As for ``surefix.evaluate``.
    quick : bool
        Fewer bootstrap samples, fewer weights, smaller maps: to see that all works, not to quote.
    """

    recall: Recall = "correct"
    quick: bool = False

    @property
    def samples(self) -> int:
        """Bootstrap samples of an interval in a table."""
        return 100 if self.quick else 2000

    @property
    def band_samples(self) -> int:
        """Bootstrap samples of each of the many intervals along a curve."""
        return 20 if self.quick else 200

    @property
    def draws(self) -> int:
        """How often a predictor with set rates is drawn."""
        return 2 if self.quick else 10


@dataclass(frozen=True, eq=False)
class Case:
    """The distances of one technique on one data set.

    Parameters
    ----------
    dataset, technique : str
    D : array of float32, shape (n, m)
        Less is more alike.
    truth, tolerance
        As for ``surefix.evaluate``.
    source : str
        Where the distances come from, in a few words.
    notes : tuple of str
        What was left out or assumed.
    generated : bool
        No camera took these images.
    aliases : tuple of str
        Other names of the data set, as the paper's own numbers may call it.
    """

    dataset: str
    technique: str
    D: Distances
    truth: Truth
    tolerance: float = 1
    source: str = ""
    notes: tuple[str, ...] = ()
    generated: bool = False
    aliases: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        places, queries = self.D.shape
        if places < 10 or queries < 10:
            raise SurefixValueError(
                f"{self.name}: expected at least 10 places and 10 queries, got {places} and {queries}"
            )
        _check_places(self.name, self.truth, places)
        # Says at once whether the distances are numbers and the truth fits them.
        evaluate(match_distances(self.D), self.truth, self.tolerance)

    @property
    def name(self) -> str:
        """For titles and legends."""
        return f"{self.dataset}, {self.technique}"

    @property
    def correct_means(self) -> str:
        """When a match is correct, in words."""
        if isinstance(self.truth, tuple):
            return f"within {self.tolerance:g} m"
        return f"within {self.tolerance:g} place{'' if self.tolerance == 1 else 's'}"

    def evaluate(self, matches: Matches, settings: Settings) -> Evaluation:
        """The curve of some matches of this case."""
        return evaluate(matches, self.truth, self.tolerance, settings.recall)

    def unweighted(self, length: int) -> Matches:
        """The sequence without weights: the paper's baseline."""
        return plain_sequence(self.D, sequence_length=length)

    def weighted(
        self, length: int, *, weight: float = WEIGHT, trusted: Flags | None = None
    ) -> Matches:
        """The sequence weighted by the consensus, or by another predictor's words; the floor is the
        paper's, global.
        """
        return weighted_sequence(self.D, sequence_length=length, weight=weight, trusted=trusted)

    def right(self) -> Flags:
        """Which single-frame matches are right: the perfect prediction."""
        return perfect_predictor(self.D, self.truth, self.tolerance)

    def trust(self) -> Trust:
        """The confusion table of the consensus."""
        return evaluate_trust(match_distances(self.D), self.truth, self.tolerance)

    def truth_from(self, query: int) -> Truth:
        """The truth of the queries from this one on."""
        return sliced(self.truth, slice(query, None))

    def truth_before(self, query: int) -> Truth:
        """The truth of the queries before this one."""
        return sliced(self.truth, slice(0, query))


def _check_places(name: str, truth: Truth, places: int) -> None:
    """A pair of positions or a matrix has a row a place; a place a query must be one of them."""
    array: npt.NDArray[np.int64] = np.asarray(truth[0] if isinstance(truth, tuple) else truth)
    if (isinstance(truth, tuple) or array.ndim == 2) and len(array) != places:
        raise SurefixValueError(
            f"{name}, truth: expected a row for each of the {places} places, got {len(array)}"
        )
    if not isinstance(truth, tuple) and array.ndim == 1 and (array >= places).any():
        query = int(np.argmax(array >= places))
        raise SurefixValueError(
            f"{name}, truth: expected places from 0 to {places - 1}, or -1, got {array[query]} for query {query}"
        )


def sliced(truth: Truth, queries: slice) -> Truth:
    """The truth of some of the queries."""
    if isinstance(truth, tuple):
        places, positions = truth
        return places, np.asarray(positions)[queries]
    array: npt.NDArray[np.int64] = np.asarray(truth)
    return array[..., queries]
