"""What techniques are worth on a route, without ground truth."""

from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from surefix._core import (
    Map,
    Run,
    Segments,
    align,
    block_length,
    described,
    match,
    match_distances,
)
from surefix.errors import mismatch
from surefix.matches import Matches
from surefix.motion import Motion

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Audit", "Estimate", "audit"]

SAMPLES = 1000

Float64 = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Places = npt.NDArray[np.int64]


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
        The belief that each query's best match alone is right (method 1.11).
    distance : array of float32, shape (m,)
        The distance of that match.
    trusted : array of bool, shape (m,)
        Whether it is trusted (Eq. 3).
    confidence : array of float64, shape (m,)
        How sure the alignment is of each query. Where it is low, ``right`` says little.
    fix_right : array of float64, shape (m,); or None
        The belief that each fix of the ``run`` is right, if there is one.
    score : array of float32, shape (m,); or None
        The score of that fix, less is better; infinite in the warm-up.
    confirmed : array of bool, shape (m,); or None
        Whether a verifier agrees with the best match, if there are ``reranked`` distances.
    techniques : tuple of Audit
        Of several techniques: an audit of each one's single matches, all by the one alignment, in
        the order in which they were given. The audit itself is that of their fusion. Empty for one
        technique.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> distances = 1 - np.eye(40, dtype=np.float32)
    >>> audit = surefix.audit(distances, motion="steady")
    >>> audit.recall_at_1 > 0.95, audit.trusted_precision.low > 0.9
    (True, True)
    """

    right: Float64
    distance: npt.NDArray[np.float32]
    trusted: Flags
    confidence: Float64
    fix_right: Float64 | None
    score: npt.NDArray[np.float32] | None
    confirmed: Flags | None
    techniques: tuple["Audit", ...]

    @property
    def recall_at_1(self) -> Estimate:
        """The share of the queries whose best match is right."""
        return _share(self.right, np.ones(len(self), bool))

    @property
    def trusted_precision(self) -> Estimate:
        """The share of the trusted matches that are right; NaN if none is trusted."""
        return _share(self.right, self.trusted)

    @property
    def confirmed_share(self) -> Estimate:
        """The share of the queries whose best match a verifier confirms: a second estimate of
        ``recall_at_1``, cruder and independent of the motion; NaN without ``reranked`` distances.
        """
        agreed = np.zeros(len(self)) if self.confirmed is None else self.confirmed.astype(float)
        return _share(agreed, np.full(len(self), self.confirmed is not None))

    def precision_at(self, distance: float) -> Estimate:
        """The share that is right of the matches at this distance or a smaller one; NaN if there
        are none.
        """
        return _share(self.right, self.distance <= distance)

    def accepted(self, score: float) -> Flags:
        """Which fixes of the run have this score or a smaller one: bool, shape (m,). The score of a
        tracker's fix is 1 - its confidence.

        Raises
        ------
        SurefixValueError
            If the audit was not given a ``run``.
        """
        if self.score is None:
            raise mismatch("run", "the fixes to audit, as audit(..., run=run)", "none")
        return np.less_equal(self.score, np.float32(score)) & np.isfinite(self.score)

    def accepted_precision(self, score: float) -> Estimate:
        """The share that is right of the fixes of the run at this score or a smaller one; NaN if
        there are none.

        Raises
        ------
        SurefixValueError
            If the audit was not given a ``run``.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> distances = 1 - np.eye(40, dtype=np.float32)
        >>> run = surefix.match_distances(distances, motion="steady")
        >>> audit = surefix.audit(distances, motion="steady", run=run)
        >>> audit.accepted_precision(1 - 0.95) > 0.95
        True
        """
        accepted = self.accepted(score)
        assert self.fix_right is not None
        return _share(self.fix_right, accepted)

    def difference(self, other: "Audit") -> Estimate:
        """How much higher the recall@1 is than another technique's of the same audit. If the
        interval holds 0, the drive does not tell which is better.

        Raises
        ------
        SurefixValueError
            If the other audit is of another number of queries.

        Examples
        --------
        >>> import numpy as np, surefix
        >>> good = 1 - np.eye(60, dtype=np.float32)
        >>> bad = np.random.default_rng(0).random((60, 60), np.float32)
        >>> one, two = surefix.audit([good, bad], motion="steady").techniques
        >>> one.difference(two).low > 0.5
        True
        """
        if len(other) != len(self):
            raise mismatch("other", f"an audit of the same {len(self)} queries", len(other))
        return _share(self.right - other.right, np.ones(len(self), bool))

    def __len__(self) -> int:
        """The number of queries."""
        return len(self.right)

    def plot(self, *, ax: "Axes | None" = None, **options: Any) -> "Axes":
        """Draws the estimates with their intervals: how often the best match is right, and how
        often a trusted one, of each technique.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; by default a new figure of ``matplotlib.pyplot``.
        **options
            As for ``surefix.plot.estimates``.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        ModuleNotFoundError
            If matplotlib is not installed.

        Examples
        --------
        >>> audit.plot().figure.savefig("audit.png")  # doctest: +SKIP
        """
        drawn: Axes = import_module("surefix.plot.objects").of_audit(self, ax=ax, **options)
        return drawn

    def _repr_html_(self) -> str:
        return str(import_module("surefix._html").of_audit(self))

    def __repr__(self) -> str:
        """The estimates in a line."""
        said = f"recall@1 {self.recall_at_1}, trusted precision {self.trusted_precision}"
        of = f" of {len(self.techniques)} techniques" if self.techniques else ""
        return f"Audit({len(self)} queries{of}, {said})"


def _share(right: Float64, chosen: Flags) -> Estimate:
    """The mean over the chosen, with the interval of a block bootstrap; NaN if none is chosen."""
    if not chosen.any():
        return Estimate(np.nan, np.nan, np.nan)
    block = block_length(np.float32(1 - right)) or 1
    counts, sums = redrawn_sums(np.stack([chosen, np.where(chosen, right, 0.0)]), block)
    low, high = np.quantile(sums[counts > 0] / counts[counts > 0], (0.025, 0.975))
    return Estimate(float(right[chosen].mean()), float(low), float(high))


def redrawn_sums(rows: Float64, block: int) -> Float64:
    """The sum of each row, (k, m), over drives redrawn from blocks of this many consecutive queries
    (the first follows on the last), as neighbours err together: shape (k, ``SAMPLES``). All rows
    are redrawn alike.
    """
    starts, lengths = drawn_blocks(rows.shape[1], block, SAMPLES)
    along = np.cumsum(np.hstack([np.zeros((len(rows), 1)), rows, rows[:, :block]]), axis=1)
    return np.asarray((along[:, starts + lengths] - along[:, starts]).sum(-1))


def drawn_blocks(m: int, block: int, samples: int) -> tuple[Places, Places]:
    """The first query of each block of each sample, and the queries of each block: the last one of
    a sample is shorter if ``m`` is no multiple of it.
    """
    starts = np.random.default_rng(0).integers(m, size=(samples, -(-m // block)))
    return starts, np.minimum(block, m - block * np.arange(starts.shape[1]))


def audit(
    map: Any,
    queries: Any = None,
    *,
    run: Run | Matches | None = None,
    reranked: npt.ArrayLike | None = None,
    motion: Motion | str = "any",
    advance: npt.ArrayLike | None = None,
    gaps: list[int] | None = None,
    segments: Segments | None = None,
    tolerance: int = 1,
    descriptor: Any = None,
    progress: Any = None,
) -> Audit:
    """Estimates how often techniques are right on a drive, without ground truth (method 1.11).

    The drive is aligned with the route by ``align``; the belief of all queries at the place of each
    query's best match is the belief that this match is right. Several techniques are fused for
    the alignment: one that is weak alone is audited better beside a strong one, and which of them
    is best does not depend on each one's own alignment.

    Parameters
    ----------
    map : Map; or array of float32, shape (n, m); or a list of maps or of arrays
        The known route; or distances, where ``distances[i, j]`` is between place ``i`` and query
        ``j``. One for each technique.
    queries : array, images or a list, optional
        As for ``match``; none with distances.
    run : Run or Matches, optional
        Fixes of the same drive, of any method, for ``accepted_precision``.
    reranked : array of float, shape (n, m), optional
        Distances by ``surefix.descriptors.Reranker``, of the same places and queries: a match is
        confirmed if their least one is within ``tolerance`` places of it.
    motion : {"any", "steady", "free"} or Motion
        How the robot moved. The estimates are as good as it: "steady" if both drives took frames
        at the same distances.
    advance, gaps, segments, descriptor, progress
        As for ``align``.
    tolerance : int
        A match is right within this many places of its segment.

    Returns
    -------
    Audit

    Raises
    ------
    SurefixValueError
        As for ``align``; for no query; for re-ranked distances of another shape or with a NaN; and
        for a run of another number of queries, or of places that there are not.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> rows = np.random.default_rng(0).normal(size=(60, 8)).astype(np.float32)
    >>> seen = rows + np.random.default_rng(1).normal(size=rows.shape).astype(np.float32)
    >>> audit = surefix.audit(surefix.Map.from_descriptors(rows), seen, motion="steady")
    >>> abs(audit.recall_at_1 - np.mean(audit.right)) < 1e-9
    True
    """
    techniques = list(map) if isinstance(map, (list, tuple)) else [map]
    if not techniques:
        raise mismatch("map", "a map or distances, or a list of them", "an empty list")
    alone: dict[str, Any] = {"gaps": gaps, "sequence_length": 1, "tolerance": tolerance}
    # What is matched: each technique alone, and first their fusion if there are several.
    several = len(techniques) > 1
    if queries is not None:
        rows = described(map, queries, descriptor, progress)
        drive: tuple[Any, ...] = (techniques, rows if several else rows[0])
        parts = list(zip(techniques, rows, strict=True))
        alone["progress"] = progress
        matched = [match(*part, **alone) for part in ([drive] if several else []) + parts]
        along = techniques[0].segments
    else:
        if any(isinstance(each, Map) for each in techniques):
            raise mismatch("queries", "images or descriptors", "none")
        drive = (techniques,)
        along = Segments(len(techniques[0])) if segments is None else segments
        alone["segments"] = segments
        matched = [match_distances(techniques, **alone)] if several else []
        matched += [match_distances(each, **alone) for each in techniques]
    singles: list[Any] = [each.single_place for each in matched]
    if not len(singles[0]):
        raise mismatch("queries", "at least one query", "none")
    verified = _verified(reranked, (len(techniques[0]), len(singles[0])))
    how: dict[str, Any] = {"motion": motion, "advance": advance, "gaps": gaps}
    how |= {"segments": segments, "tolerance": tolerance, "progress": progress}
    aligned = align(*drive, at=[*singles, *_places(run, techniques[0], len(singles[0]))], **how)
    audits = [
        Audit(
            right,
            each.single_distance,
            each.trusted,
            aligned.confidence,
            None,
            None,
            None if verified is None else along.are_near(each.single_place, verified, tolerance),
            (),
        )
        for right, each in zip(aligned.right, matched, strict=False)
    ]
    whole = replace(audits[0], techniques=tuple(audits[1:]))
    if run is None:
        return whole
    ready: Any = run.ready
    score = np.where(ready, run.score, np.float32(np.inf))
    return replace(whole, fix_right=aligned.right[-1], score=score)


def _verified(reranked: Any, shape: tuple[int, int]) -> npt.NDArray[np.int64] | None:
    """The verified place of each query; None without re-ranked distances."""
    if reranked is None:
        return None
    given = np.asarray(reranked)
    if given.shape != shape or given.dtype.kind not in "fiu":
        got = f"{given.dtype} {given.shape}"
        raise mismatch("reranked", f"numbers of the shape {shape}, (places, queries)", got)
    if np.isnan(given).any():
        place, query = np.argwhere(np.isnan(given))[0]
        raise mismatch("reranked", "numbers", f"NaN at place {place}, query {query}")
    places: npt.NDArray[np.int64] = given.argmin(0)
    return places


def _places(run: Any, first: Any, queries: int) -> list[npt.NDArray[np.int64]]:
    """The places of the run, checked; none without one."""
    if run is None:
        return []
    if len(run) != queries:
        raise mismatch("run", f"a fix for each of {queries} queries", len(run))
    places = len(first)
    wrong = np.flatnonzero((run.place < 0) | (run.place >= places))
    if len(wrong):
        got = f"{run.place[wrong[0]]} at query {wrong[0]}"
        raise mismatch("run", f"places from 0 to {places - 1}", got)
    return [run.place]
