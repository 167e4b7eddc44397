"""Recursive filters over the places: surefix's tracker, and a published topological filter."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from surefix._core import Segments, match_distances
from surefix.baselines.distances import Distances, Floats, nearest, whole
from surefix.matches import Matches

__all__ = ["topological", "track"]

# The belief that moves on by 0, 1 and 2 places.
KERNEL = (0.1, 0.8, 0.1)
DELTA = 5.0


def topological(D: Distances, *, reach: int = 6) -> Matches:
    """The place of greatest belief of a discrete Bayes filter: the topological filter of Xu,
    Sünderhauf and Milford, *Probabilistic Visual Place Recognition for Hierarchical Localization*,
    RA-L 2021 (arXiv 2105.03091).

    The evidence for a place is ``exp(-lambda * (d - median(d)))``, with ``lambda = ln 5 / (q97.5 -
    q2.5)`` from two quantiles of the first query's distances, once for all queries. The belief
    starts even and moves on by 0, 1 and 2 places with the probabilities 0.1, 0.8 and 0.1: the
    authors' window, -2 to 10 places, is for maps with some places a query. It has no state for a
    robot off the map, and no correction for places that look like many.

    Parameters
    ----------
    D : array of float32, shape (n, m)
    reach : int
        The confidence is the belief within this many places of the best.

    Returns
    -------
    Matches
        Scored by 1 minus the confidence, which is in ``confidence``.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix import baselines
    >>> matches = baselines.topological(1 - np.eye(30, dtype=np.float32), reach=1)
    >>> matches.place[5:9], matches.confidence[29] > 0.9
    (array([5, 6, 7, 8]), np.True_)
    """
    nearest(D)
    D = np.asarray(D)
    reach = whole("reach", reach, 0)
    places, confidence = np.zeros(D.shape[1], np.int64), np.zeros(D.shape[1])
    belief, weight = np.full(len(D), 1 / len(D)), 0.0
    for query, column in enumerate(D.T.astype(np.float64)):
        if query:
            belief = np.convolve(belief, KERNEL)[: len(D)]
        if not weight:
            # A first query that says nothing says nothing about the spread either.
            low, high = np.quantile(column, (0.025, 0.975))
            weight = np.log(DELTA) / (high - low) if high > low else 0.0
        # The median cancels out. From the best place that has belief on, all cannot vanish.
        belief *= np.exp(np.minimum(-weight * (column - column[belief > 0].min()), 0))
        belief /= belief.sum()
        best = places[query] = np.argmax(belief)
        confidence[query] = belief[max(0, best - reach) : best + reach + 1].sum()
    return _matches(places, confidence)


def track(
    D: Distances | Sequence[Distances],
    *,
    motion: Any = "free",
    advance: Floats | None = None,
    tolerance: int = 1,
    segments: Segments | None = None,
    gaps: Sequence[int] = (),
    technique_weights: Sequence[float] = (),
) -> Matches:
    """The place of greatest belief of surefix's tracker.

    Parameters
    ----------
    D : array of float32, shape (n, m), or a list of such
        Those of several techniques are fused.
    motion : {"steady", "free", "any"} or surefix.Motion
    advance : array of float64, shape (m,), optional
        Places moved since the query before, by odometry.
    tolerance : int
        The confidence is the belief within this many places of the best.
    segments : Segments, optional
        How the places follow each other.
    gaps, technique_weights
        As for ``surefix.match_distances``.

    Returns
    -------
    Matches
        Scored by 1 minus the confidence, with ``confidence`` and ``off_map``.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix import baselines
    >>> baselines.track(1 - np.eye(30, dtype=np.float32)).place[5:9]
    array([5, 6, 7, 8])
    """
    options: Any = {"tolerance": tolerance, "sequence_length": 1, "gaps": list(gaps)}
    options |= {"technique_weights": list(technique_weights)} if technique_weights else {}
    run = match_distances(D, motion=motion, advance=advance, segments=segments, **options)
    return _matches(run.place, run.confidence, run.off_map)


def _matches(place: Any, confidence: Any, off_map: Any = None) -> Matches:
    return Matches(place=place, score=1 - confidence, confidence=confidence, off_map=off_map)
