"""A case: the distances of one technique on one data set with the truth, and the settings that all
cases share.
"""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from surefix.baselines import Context
from surefix.baselines.distances import Distances
from surefix.baselines.truth import Truth, by_metres
from surefix.errors import SurefixValueError
from surefix.study import Recall, Study

__all__ = ["LENGTH", "WEIGHT", "Case", "Settings", "sliced"]

# The paper's weight and length.
WEIGHT = 0.99
LENGTH = 2


@dataclass(frozen=True)
class Settings:
    """The settings of every exhibit.

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
        """Draws of a predictor with set rates."""
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
        The origin of the distances, in a few words.
    notes : tuple of str
        Anything that was left out or assumed.
    generated : bool
        No camera took these images.
    aliases : tuple of str
        Other names of the data set that the paper's own numbers may use.
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
    _studies: dict[Settings, Study] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        places, queries = self.D.shape
        if places < 10 or queries < 10:
            expected = "at least 10 places and 10 queries"
            raise SurefixValueError(f"{self.name}: expected {expected}, got {places} and {queries}")
        study = self.study(Settings())
        try:
            _ = study.baseline.curve, study.single_right
        except SurefixValueError as error:
            raise SurefixValueError(f"{self.name}, {error}") from None

    @property
    def name(self) -> str:
        """For titles and legends."""
        return f"{self.dataset}, {self.technique}"

    def study(self, settings: Settings) -> Study:
        """The plain and the weighted sequence on these distances: the same study each time."""
        if settings not in self._studies:
            context = Context(
                sequence_length=LENGTH,
                weight=WEIGHT,
                truth=self.truth,
                truth_tolerance=self.tolerance,
            )
            self._studies[settings] = Study(self.D, context, settings.recall, settings.samples)
        return self._studies[settings]


def sliced(truth: Truth, queries: slice) -> Truth:
    """The truth of some of the queries."""
    if by_metres(truth):
        places, positions = truth
        return places, np.asarray(positions)[queries]
    array: npt.NDArray[np.int64] = np.asarray(truth)
    return array[..., queries]
