"""Is a confidence as often right as it says, and how soon does a method notice that it is lost, and
find back?
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from surefix.baselines.distances import Flags, Floats, Places, number, whole
from surefix.errors import mismatch

__all__ = ["Reliability", "frames_to_notice", "frames_to_relocalise", "reliability", "roc_area"]

# Less sure than this of its place, or surer than this to be off the map: it has noticed.
ALARM = 0.5
# At least as sure as this, and right for this many queries: it is back.
SURE, HOLD = 0.5, 3


@dataclass(frozen=True, eq=False)
class Reliability:
    """A reliability diagram: confidences in bins of equal width, those without queries left out.

    Parameters
    ----------
    count : array of int64, shape (k,)
        Queries.
    said, right : arrays of float64, shape (k,)
        Their mean confidence, and the share of them that is right.
    """

    count: Places
    said: Floats
    right: Floats

    @property
    def error(self) -> float:
        """The expected calibration error: by how much ``said`` and ``right`` differ, as a mean over
        queries; NaN without queries.
        """
        if not len(self.count):
            return float("nan")
        return float(np.average(np.abs(self.said - self.right), weights=self.count))


def reliability(confidence: npt.ArrayLike, right: npt.ArrayLike, bins: int = 10) -> Reliability:
    """What was said against what was right.

    Parameters
    ----------
    confidence : array of float, shape (m,)
        From 0 to 1.
    right : array of bool, shape (m,)
    bins : int
        A confidence on an edge belongs to the bin below it, as in scikit-learn.

    Returns
    -------
    Reliability

    Raises
    ------
    SurefixValueError
        For other shapes, or confidences outside 0 to 1.

    Examples
    --------
    >>> from surefix.study import reliability
    >>> diagram = reliability([0.9, 0.9, 0.95, 0.2], [True, False, True, False])
    >>> diagram.count, round(diagram.error, 4)
    (array([1, 2, 1]), 0.2625)
    """
    said, hit = _alike("confidence", confidence, right)
    # Sums of probabilities may pass 1 by a rounding error.
    if not ((said >= 0) & (said <= 1 + 1e-6)).all():
        query = int(np.argmin((said >= 0) & (said <= 1 + 1e-6)))
        raise mismatch("confidence", "probabilities from 0 to 1", f"{said[query]} at {query}")
    edges = np.linspace(0, 1, whole("bins", bins, 1) + 1)
    which = np.searchsorted(edges[1:-1], said)
    count = np.bincount(which, minlength=bins)
    kept = count > 0
    sums = (np.bincount(which, values, bins)[kept] for values in (said, hit))
    means = (total / count[kept] for total in sums)
    return Reliability(count[kept], *means)


def roc_area(score: npt.ArrayLike, positive: npt.ArrayLike) -> float:
    """The area under the ROC curve: how often a positive has the higher score of two, ties half.

    Parameters
    ----------
    score : array of float, shape (m,)
    positive : array of bool, shape (m,)

    Returns
    -------
    float
        From 0 to 1, 0.5 by chance; NaN without a positive or without a negative.

    Examples
    --------
    >>> from surefix.study import roc_area
    >>> roc_area([0.1, 0.4, 0.35, 0.8], [False, False, True, True])
    0.75
    """
    values, flags = _alike("score", score, positive)
    _, which, counts = np.unique(values, return_inverse=True, return_counts=True)
    # The mean rank of each value.
    rank = (np.cumsum(counts) - (counts - 1) / 2)[which]
    ones = int(flags.sum())
    pairs = ones * (len(flags) - ones)
    if not pairs:
        return float("nan")
    return float((rank[flags].sum() - ones * (ones + 1) / 2) / pairs)


def frames_to_notice(doubt: npt.ArrayLike, off: npt.ArrayLike, alarm: float = ALARM) -> Floats:
    """Queries from leaving the map until the method says so.

    Parameters
    ----------
    doubt : array of float, shape (m,)
        The larger of the probability to be off the map and 1 minus the confidence.
    off : array of bool, shape (m,)
        Which queries are off the map.
    alarm : float
        It has noticed when ``doubt`` is at least this.

    Returns
    -------
    array of float64
        For each stretch off the map: 0 if it is noticed at its first query, infinity if the robot
        is back before it is noticed.

    Examples
    --------
    >>> from surefix.study import frames_to_notice
    >>> frames_to_notice([0, 0.1, 0.3, 0.7, 0.1, 0.2], [False, True, True, True, False, True])
    array([ 2., inf])
    """
    doubts, away = _alike("doubt", doubt, off)
    noticed = doubts >= alarm
    edges = np.flatnonzero(np.diff(away.astype(np.int8), prepend=0, append=0))
    return _first(noticed, edges[::2], edges[1::2])


def frames_to_relocalise(
    right: npt.ArrayLike,
    off: npt.ArrayLike,
    jumps: npt.ArrayLike = (),
    *,
    confidence: npt.ArrayLike | None = None,
    sure: float = SURE,
    hold: int = HOLD,
) -> Floats:
    """Queries from a kidnap, or from the return to the map, until the method has the place again.

    It has it at the first query that is right with a confidence of at least ``sure`` and that
    begins ``hold`` right ones.

    Parameters
    ----------
    right : array of bool, shape (m,)
        Which answers are right.
    off : array of bool, shape (m,)
        Which queries are off the map.
    jumps : array of int
        The first query after each kidnap. One that leads off the map counts from its return on.
    confidence : array of float, shape (m,), optional
        By default being right is enough.
    sure : float
    hold : int
        In queries.

    Returns
    -------
    array of float64
        For each kidnap and each return, in order: 0 if its first query is right, infinity if the
        robot leaves the map, is kidnapped again or ends its drive before it has its place.

    Examples
    --------
    >>> from surefix.study import frames_to_relocalise
    >>> frames_to_relocalise([1, 1, 0, 1, 0, 1, 1, 1, 1], [0] * 9, jumps=[2])
    array([3.])
    """
    hit, away = _alike("right", right, off)
    hit = hit.astype(bool)
    event = np.diff(away.astype(np.int8), prepend=0) < 0
    event[np.asarray(jumps, np.int64)] = True
    starts = np.flatnonzero(event & ~away)
    # Each lasts until the next one begins, or the robot leaves the map.
    ends = np.append(np.flatnonzero(event | away), len(hit))
    stops = ends[np.searchsorted(ends, starts, side="right")]
    begins = np.zeros(len(hit), bool)
    if len(hit) >= hold:
        begins[: len(hit) - hold + 1] = np.lib.stride_tricks.sliding_window_view(hit, hold).all(1)
    if confidence is not None:
        begins &= _alike("confidence", confidence, hit)[0] >= number("sure", sure, 0, 1)
    # The last queries of an event cannot hold.
    return _first(begins, starts, np.maximum(stops - hold + 1, starts))


def _first(true: Flags, starts: Places, stops: Places) -> Floats:
    """From each start on, queries until the first that is true, infinity for none by its stop."""
    found = np.full(len(starts), np.inf)
    for event, (start, stop) in enumerate(zip(starts, stops, strict=True)):
        if true[start:stop].any():
            found[event] = np.argmax(true[start:stop])
    return found


def _alike(name: str, values: npt.ArrayLike, flags: npt.ArrayLike) -> tuple[Floats, Flags]:
    """Finite numbers and flags, one each a query."""
    numbers, bools = np.asarray(values, np.float64), np.asarray(flags).astype(bool)
    if numbers.ndim != 1 or numbers.shape != bools.shape:
        got = f"the shapes {numbers.shape} and {bools.shape}"
        raise mismatch(name, "a number and a flag a query, both (m,)", got)
    if not np.isfinite(numbers).all():
        query = int(np.argmin(np.isfinite(numbers)))
        raise mismatch(name, "finite numbers", f"{numbers[query]} at {query}")
    return numbers, bools
