"""The drive of ``surefix demo``: the tracker and its confidence beside a study of the sequence."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from surefix import Run
from surefix.baselines.distances import Flags, Floats
from surefix.matches import Matches
from surefix.simulate import Traverse
from surefix.study.study import Result, Study

__all__ = ["ACCEPT", "Demo"]

# A fix of this confidence or more is sure.
ACCEPT = 0.95


@dataclass(frozen=True, eq=False)
class Demo:
    """A drive along a generated route, localized on the map of an earlier drive.

    Attributes
    ----------
    study : Study
        Of the distances that the localizer saw, with the truth and the odometry in places.
    run : Run
        The fixes of the localizer, with its tracker.
    reference, revisit : Traverse
        The drive that was mapped, and the one that was localized.
    seed : int
    latency : array of float64, shape (m,)
        Seconds that each push took.
    """

    study: Study
    run: Run
    reference: Traverse
    revisit: Traverse
    seed: int
    latency: Floats

    @cached_property
    def tracker(self) -> Result:
        """The fixes as matches, judged by the truth."""
        run = self.run
        said = Matches(run.place, run.score, None, None, run.confidence, run.off_map)
        return Result(self.study, "the tracker", said)

    @property
    def right(self) -> Flags:
        """Which fixes are right."""
        return self.tracker.right

    @property
    def sure(self) -> Flags:
        """Which fixes are sure."""
        assert self.run.confidence is not None
        return np.greater_equal(self.run.confidence, ACCEPT)

    @property
    def standing(self) -> Flags:
        """Which frames were taken while the drive stood still."""
        still: Flags = self.revisit.odometry() == 0
        still[0] = False
        return still

    @property
    def trusted_point(self) -> tuple[float, float] | None:
        """Recall and precision of the trusted fixes of the weighted sequence, as the curves count;
        None without any.
        """
        weighted, ready, trusted = self.study.shown.right, self.study.run.ready, self.run.trusted
        accepted = int((ready & trusted).sum())
        found = int((ready & trusted & weighted).sum())
        correct = max(1, int((ready & weighted).sum()))
        return (found / correct, found / accepted) if accepted else None

    def off(self, query: int) -> str:
        """The distance along the road between a fix and the camera, in words."""
        place = self.reference.positions[self.run.place[query]]
        metres = abs(place - self.revisit.positions[query])
        return "not on the map" if np.isnan(metres) else f"{metres:.0f} m off"
