"""What ``plot`` of a run, an alignment, an evaluation, an audit, a trust table and a map draws."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from surefix._core import Alignment, Evaluation, Map, Run, Trust, judged
from surefix.auditing import Audit
from surefix.contradicting import true_places
from surefix.errors import mismatch
from surefix.plot.bars import Estimate, estimates, trust_table
from surefix.plot.belief import confidence
from surefix.plot.curves import precision_recall
from surefix.plot.matrix import Window, aligned_track, distance_matrix
from surefix.plot.plan import plan

__all__ = ["of_alignment", "of_audit", "of_evaluation", "of_map", "of_run", "of_trust"]

# The most rows and columns of a picture: no screen shows more of them.
PICTURE = 1500

Flags = NDArray[np.bool_]
Matched = tuple[NDArray[np.int64], Flags | None, Flags]
"""Places, which of them are right, if that is known, and which are drawn: each of shape (m,)."""


def of_run(
    run: Run,
    truth: Any = None,
    tolerance: float = 1,
    single: bool = False,
    kind: str = "matrix",
    **options: Any,
) -> Axes:
    """As ``Run.plot``."""
    place = run.single_place if single else run.place
    kinds: dict[str, Callable[..., Axes]] = {"matrix": _matrix, "confidence": _confidence}
    if kind not in kinds:
        raise mismatch("kind", '"matrix" or "confidence"', repr(kind))
    right, shown = None, np.full(len(run), single) | run.ready
    if truth is not None:
        right, known = judged(place, truth, float(tolerance), run.segments)
        shown = shown & known
        if kind == "matrix":
            options.setdefault("truth", true_places(run, truth, tolerance))
    return kinds[kind](run, (place, right, shown), **options)


def _matrix(run: Run, matched: Matched, **options: Any) -> Axes:
    place, right, shown = matched
    queries, places = options.get("queries"), options.get("places")
    D, covers = part_of(run.distances, queries, places)
    given: dict[str, Any] = {"judged": shown, "breaks": run.segments.breaks, "covers": covers}
    return distance_matrix(D, place, run.trusted, right, **given | options)


def _confidence(run: Run, matched: Matched, **options: Any) -> Axes:
    sure, off = run.confidence, run.off_map
    if sure is None or off is None:
        expected = 'a run with motion, such as motion="any", to draw "confidence"'
        raise mismatch("kind", expected, run)
    return confidence(sure, off, matched[1], **options)


def of_alignment(alignment: Alignment, **options: Any) -> Axes:
    """As ``Alignment.plot``."""
    D, _ = part_of(alignment.distances)
    along = alignment.segments
    given: dict[str, Any] = {"places": along.places, "breaks": along.breaks}
    return aligned_track(
        D, alignment.place, alignment.confidence, alignment.off_map, **given | options
    )


def of_evaluation(curve: Evaluation, name: str = "", **options: Any) -> Axes:
    """As ``Evaluation.plot``."""
    return precision_recall({name: curve}, **options)


def of_trust(trust: Trust, **options: Any) -> Axes:
    """As ``Trust.plot``."""
    return trust_table(trust, **options)


def of_audit(audit: Audit, **options: Any) -> Axes:
    """As ``Audit.plot``."""
    rows: dict[str, Estimate] = {}
    each = {f"technique {k}: ": one for k, one in enumerate(audit.techniques)}
    for name, one in {"fused: " if each else "": audit, **each}.items():
        shares = {
            "best match is right": one.recall_at_1,
            "trusted match is right": one.trusted_precision,
        }
        if one.confirmed is not None:
            shares["confirmed by the verifier"] = one.confirmed_share
        for what, share in shares.items():
            rows[name + what] = float(share), share.low, share.high
    return estimates(rows, **options)


def of_map(route: Map, **options: Any) -> Axes:
    """As ``Map.plot``."""
    if route.positions is None:
        raise mismatch("map", "positions, as Map.with_positions gives them", "none")
    return plan(route.positions, route.segments, **options)


def part_of(
    distances: NDArray[np.float32], queries: Window | None = None, places: Window | None = None
) -> tuple[NDArray[np.float32], tuple[Window, Window]]:
    """The distances of these queries and places, of all by default, and what they cover. Of more
    than ``PICTURE`` rows or columns only as many are left, each with the least of some distances.
    """
    n, m = distances.shape
    first, count = _window("queries", queries, m)
    low, height = _window("places", places, n)
    part = distances[low : low + height, first : first + count]
    down, across = (max(1, -(-size // PICTURE)) for size in part.shape)
    if part.size and (down, across) != (1, 1):
        part = np.minimum.reduceat(part, np.arange(0, part.shape[1], across), axis=1)
        part = np.minimum.reduceat(part, np.arange(0, part.shape[0], down), axis=0)
    return part, ((first, part.shape[1] * across), (low, part.shape[0] * down))


def _window(name: str, given: Any, size: int) -> Window:
    """The first and the number of some of ``size`` queries or places, all by default."""
    if given is None:
        return 0, size
    whole = np.shape(given) == (2,) and all(isinstance(each, int | np.integer) for each in given)
    if not whole or not 0 <= given[0] < given[0] + given[1] <= size:
        expected = f"the first and how many, as (first, count) within {size}"
        raise mismatch(name, expected, given)
    return int(given[0]), int(given[1])
