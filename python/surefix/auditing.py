"""What a technique is worth on a route, without ground truth."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix._core import Map, align, match, match_distances
from surefix.errors import mismatch
from surefix.motion import Motion

__all__ = ["Audit", "Estimate", "audit"]

SAMPLES = 1000


class Estimate(float):
    """A number, and the ends of its 95 % interval: ``low`` and ``high``.

    Examples
    --------
    >>> import surefix
    >>> share = surefix.Estimate(0.5, 0.4, 0.6)
    >>> share + 0, share.low, share.high
    (0.5, 0.4, 0.6)
    """

    low: float
    high: float

    def __new__(cls, value: float, low: float, high: float) -> "Estimate":
        """A float with two attributes."""
        estimate = super().__new__(cls, value)
        estimate.low, estimate.high = low, high
        return estimate

    def __reduce__(self) -> tuple[Any, ...]:
        """So that it can be copied and pickled."""
        return Estimate, (float(self), self.low, self.high)

    def __str__(self) -> str:
        """The number and its interval, to three decimals."""
        return f"{float(self):.3f} ({self.low:.3f} to {self.high:.3f})"


@dataclass(frozen=True, eq=False)
class Audit:
    """Estimates of a technique's worth on a drive, by ``audit``.

    Attributes
    ----------
    right : array of float64, shape (m,)
        The probability that each query's best match alone is right (method 1.11).
    distance : array of float32, shape (m,)
        The distance of that match.
    trusted : array of bool, shape (m,)
        Whether it is trusted (Eq. 3).
    confidence : array of float64, shape (m,)
        How sure the alignment is of each query. Where it is low, ``right`` says little.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> distances = 1 - np.eye(40, dtype=np.float32)
    >>> audit = surefix.audit(distances, motion="steady")
    >>> audit.recall_at_1 > 0.95, audit.trusted_precision.low > 0.9
    (True, True)
    """

    right: npt.NDArray[np.float64]
    distance: npt.NDArray[np.float32]
    trusted: npt.NDArray[np.bool_]
    confidence: npt.NDArray[np.float64]

    @property
    def recall_at_1(self) -> Estimate:
        """The share of the queries whose best match is right."""
        return self._share(np.ones(len(self.right), bool))

    @property
    def trusted_precision(self) -> Estimate:
        """The share of the trusted matches that are right; NaN if none is trusted."""
        return self._share(self.trusted)

    def precision_at(self, distance: float) -> Estimate:
        """The share that is right of the matches at this distance or a smaller one; NaN if there
        are none.
        """
        return self._share(self.distance <= distance)

    def _share(self, chosen: npt.NDArray[np.bool_]) -> Estimate:
        """The mean of ``right`` over the chosen, with the interval of a bootstrap over blocks of
        consecutive queries, as ``Evaluation.auc_interval`` takes them: neighbours err together.
        """
        m = len(self.right)
        if not chosen.any():
            return Estimate(np.nan, np.nan, np.nan)
        length = max(1, round(m**0.5))
        generator = np.random.default_rng(0)
        starts = generator.integers(m, size=(SAMPLES, -(-m // length)))
        drawn = (starts[:, :, None] + np.arange(length)).reshape(SAMPLES, -1)[:, :m] % m
        counts = chosen[drawn].sum(1)
        sums = np.where(chosen, self.right, 0)[drawn].sum(1)
        # The alignment's own doubt, beside that of which queries were driven.
        shares = sums[counts > 0] / counts[counts > 0]
        low, high = np.quantile(shares, (0.025, 0.975))
        return Estimate(float(self.right[chosen].mean()), float(low), float(high))

    def __len__(self) -> int:
        """The number of queries."""
        return len(self.right)

    def __repr__(self) -> str:
        """The estimates in a line."""
        said = f"recall@1 {self.recall_at_1}, trusted precision {self.trusted_precision}"
        return f"Audit({len(self)} queries, {said})"


def audit(
    map: Any,
    queries: Any = None,
    *,
    motion: Motion | str = "any",
    advance: npt.ArrayLike | None = None,
    gaps: list[int] | None = None,
    tolerance: int = 1,
    descriptor: Any = None,
    progress: Any = None,
) -> Audit:
    """Estimates how often a technique is right on a drive, without ground truth (method 1.11).

    The drive is aligned with the route by ``align``; the belief of all queries at the place of each
    query's best match is the probability that this match is right.

    Parameters
    ----------
    map : Map; or array of float32, shape (n, m)
        The known route; or distances, where ``distances[i, j]`` is between place ``i`` and query
        ``j``.
    queries : array or images, optional
        As for ``match``; none with distances.
    motion : {"any", "steady", "free"} or Motion
        How the robot moved. The estimates are as good as it: "steady" if both drives took frames
        at the same distances.
    advance, gaps, descriptor, progress
        As for ``align``.
    tolerance : int
        A match is right within this many places.

    Returns
    -------
    Audit

    Raises
    ------
    SurefixValueError
        As for ``align``, and for no query.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> rows = np.random.default_rng(0).normal(size=(60, 8)).astype(np.float32)
    >>> seen = rows + np.random.default_rng(1).normal(size=rows.shape).astype(np.float32)
    >>> audit = surefix.audit(surefix.Map.from_descriptors(rows), seen, motion="steady")
    >>> abs(audit.recall_at_1 - np.mean(audit.right)) < 1e-9
    True
    """
    how: dict[str, Any] = {"advance": advance, "gaps": gaps}
    aligned = align(
        map,
        queries,
        motion=motion,
        tolerance=tolerance,
        descriptor=descriptor,
        progress=progress,
        **how,
    )
    if not len(aligned):
        raise mismatch("queries", "at least one query", "none")
    options: Any = {"sequence_length": 1, "tolerance": tolerance}
    if isinstance(map, Map):
        run = match(map, queries, descriptor=descriptor, gaps=gaps, **options)
    else:
        run = match_distances(map, gaps=gaps, **options)
    return Audit(aligned.single_right, run.single_distance, run.trusted, aligned.confidence)
