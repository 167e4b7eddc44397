"""Where a truth contradicts an alignment of the same drive."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix._core import Alignment, Run
from surefix.errors import mismatch

# An alignment that is less sure contradicts nothing.
SURE = 0.95
# It may be a place or two off.
NEAR = 2
# Fewer queries in a row are a slip of the alignment's.
QUERIES = 3
# One that passes no more places may be held by a place that looks like everything: on 11 of 140
# drives made of real routes it contradicted a right truth, each time so.
STANDS = 1


@dataclass(frozen=True)
class Contradiction:
    """Queries in a row whose truth is elsewhere than a sure alignment.

    Attributes
    ----------
    first, last : int
        The first and the last query.
    truth, aligned : (int, int)
        The places of these two queries, by the truth and by the alignment.
    """

    first: int
    last: int
    truth: tuple[int, int]
    aligned: tuple[int, int]

    def __str__(self) -> str:
        """The queries and both places."""
        truth, aligned = ("{} to {}".format(*each) for each in (self.truth, self.aligned))
        places = f"places {truth} by the truth, {aligned} by the alignment"
        return f"queries {self.first} to {self.last}: {places}"


def contradictions(alignment: Alignment, truth: Any, tolerance: float = 1) -> list[Contradiction]:
    """Where a truth disagrees with an alignment that is sure of itself: it may be the truth that is
    wrong.

    At least three queries in a row, of which the alignment is more than 95 % sure, are more than
    ``tolerance`` + 2 places away. Queries that the truth has no place for are left out, and
    stretches in which the alignment stands.

    Parameters
    ----------
    alignment : Alignment
    truth : array or pair of arrays
        As for ``evaluate``.
    tolerance : float
        As for ``evaluate``; of positions, those within it, in metres, are true, and 1 place more
        is right.

    Returns
    -------
    list of Contradiction

    Examples
    --------
    >>> import numpy as np, surefix
    >>> alignment = surefix.align(1 - np.eye(60, dtype=np.float32), motion="steady")
    >>> truth = np.arange(60)
    >>> truth[20:30] += 9
    >>> print(*surefix.contradictions(alignment, truth))
    queries 20 to 29: places 29 to 38 by the truth, 20 to 29 by the alignment
    """
    places = true_places(alignment, truth, tolerance)
    aligned = np.asarray(alignment.place)
    within = (1 if isinstance(truth, tuple) else tolerance) + NEAR
    far = (places >= 0) & (np.abs(places - aligned) > within) & (alignment.confidence > SURE)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], far, [False]))))
    return [
        Contradiction(
            int(first),
            int(end) - 1,
            (int(places[first]), int(places[end - 1])),
            (int(aligned[first]), int(aligned[end - 1])),
        )
        for first, end in zip(edges[::2], edges[1::2], strict=True)
        if end - first >= QUERIES and np.ptp(aligned[first:end]) > STANDS
    ]


def known_queries(truth: Any) -> npt.NDArray[np.bool_]:
    """Which queries of a truth, as for ``evaluate``, have a place that is known, (m,): not so a
    NaN, or a position with one.
    """
    pair = isinstance(truth, tuple) and len(truth) == 2 and np.ndim(truth[0]) > 0
    here = np.asarray(truth[1] if pair else truth)
    if here.dtype.kind != "f":
        return np.ones(len(here) if pair else here.shape[-1], bool)
    unknown = np.isnan(here)
    return np.asarray(~(unknown.any(axis=1) if pair else unknown), bool)


def true_places(alignment: Alignment | Run, truth: Any, tolerance: float) -> npt.NDArray[np.int64]:
    """The true place of each query, of several the one nearest to that found; -1 for none, and
    if it is not known.

    Raises
    ------
    SurefixValueError
        If the truth is of another number of queries, or not as for ``evaluate``.
    """
    aligned = np.asarray(alignment.place)
    if not isinstance(truth, tuple) and np.ndim(truth) == 1:
        given = np.asarray(truth)
        whole = given.dtype.kind in "iu"
        if given.dtype.kind == "f":
            whole = bool((np.isnan(given) | (given == np.round(given))).all())
        if given.size and not whole:
            raise mismatch("truth", "whole numbers, -1 for no place", given.dtype)
        places = np.where(np.isnan(given), -1, given).astype(np.int64)
        if len(places) != len(aligned):
            raise mismatch("truth", f"a place for each of {len(aligned)} queries", len(places))
        return places
    found = np.full(len(aligned), -1)
    if isinstance(truth, tuple):
        there, here = (np.asarray(each, np.float64) for each in truth)
        if there.ndim != 2 or here.ndim != 2 or there.shape[1] != here.shape[1]:
            expected = "positions of the places and of the queries, with the same axes"
            raise mismatch("truth", expected, f"{there.shape} and {here.shape}")
        count = len(here)
    else:
        cells = np.asarray(truth)
        count = cells.shape[1] if cells.ndim == 2 else 0
    if count != len(aligned):
        raise mismatch("truth", f"a place for each of {len(aligned)} queries", count)
    for query, place in enumerate(aligned):
        if isinstance(truth, tuple):
            away = np.linalg.norm(there - here[query], axis=1)
            true = np.flatnonzero(away <= tolerance)
        else:
            true = np.flatnonzero(cells[:, query] == 1)
        if len(true):
            found[query] = true[np.argmin(np.abs(true - place))]
    return found
