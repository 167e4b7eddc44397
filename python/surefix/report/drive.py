"""A finished drive: what came in, what came out, and the counts that pictures and sentences are
made from.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from surefix import Evaluation, Run, evaluate
from surefix.plot.outcome import Gap, Outcome, is_right, longest_gap, outcomes
from surefix.simulate import Traverse

__all__ = ["Drive"]


@dataclass(frozen=True)
class Drive:
    """A drive along a generated route, localized on the map of an earlier drive.

    Attributes
    ----------
    reference, revisit : Traverse
        The drive that was mapped, and the one that was localized.
    size : (int, int)
        Width and height of a frame.
    distances : array of float32, shape (n, m)
        The distance between each place and each query, as the localizer saw them.
    run, baseline : Run
        The fixes; and those of the sequence without weighting, from the same distances.
    latency : array of float64, shape (m,)
        Seconds that each push took.
    """

    reference: Traverse
    revisit: Traverse
    size: tuple[int, int]
    seed: int
    sequence_length: int
    distances: NDArray[np.float32]
    run: Run
    baseline: Run
    latency: NDArray[np.float64]
    tolerance: int = 1

    @cached_property
    def truth(self) -> NDArray[np.int64]:
        """The true place of each query."""
        return self.revisit.truth(self.reference)

    @cached_property
    def right(self) -> NDArray[np.bool_]:
        """Which fixes are right."""
        return is_right(self.run.place, self.truth, self.tolerance)

    @cached_property
    def baseline_right(self) -> NDArray[np.bool_]:
        """Which matches of the unweighted sequence are right."""
        return is_right(self.baseline.place, self.truth, self.tolerance)

    @cached_property
    def single_right(self) -> NDArray[np.bool_]:
        """Which single matches are right."""
        return is_right(self.run.single_place, self.truth, self.tolerance)

    @cached_property
    def masks(self) -> dict[Outcome, NDArray[np.bool_]]:
        """Which fixes had each outcome."""
        return outcomes(self.right, self.run.trusted)

    @cached_property
    def counts(self) -> dict[Outcome, int]:
        """How many fixes had each outcome."""
        return {outcome: int(mask.sum()) for outcome, mask in self.masks.items()}

    @cached_property
    def weighted_curve(self) -> Evaluation:
        """The precision-recall curve of the fixes."""
        return evaluate(self.run, self.truth, self.tolerance)

    @cached_property
    def baseline_curve(self) -> Evaluation:
        """The precision-recall curve of the unweighted sequence."""
        return evaluate(self.baseline, self.truth, self.tolerance)

    @property
    def trusted_point(self) -> tuple[float, float] | None:
        """Recall and precision of accepting just the trusted fixes, as the curves count; None
        without any.
        """
        ready, trusted = self.run.ready, self.run.trusted
        accepted = int((ready & trusted).sum())
        if accepted == 0:
            return None
        found = int((ready & trusted & self.right).sum())
        return found / max(1, int((ready & self.right).sum())), found / accepted

    @property
    def trusted_name(self) -> str:
        """What that point is of: the curves leave out fixes whose window is not full."""
        return f"the trusted fixes{'' if self.run.ready.all() else ' of full windows'} alone"

    @cached_property
    def metres_off(self) -> NDArray[np.float64]:
        """How far along the road each fix is from where the camera was."""
        return np.abs(self.reference.positions[self.run.place] - self.revisit.positions)

    @cached_property
    def gap(self) -> Gap:
        """The longest stretch of queries without a fix that is trusted and right."""
        return longest_gap(self.masks[Outcome.TRUSTED_RIGHT])

    @cached_property
    def gap_metres(self) -> tuple[float, float]:
        """Where that stretch is: from the last such fix before it to the first after it, or to an
        end.
        """
        positions, gap = self.revisit.positions, self.gap
        return float(positions[max(gap.start - 1, 0)]), float(
            positions[min(gap.stop, len(positions) - 1)]
        )
