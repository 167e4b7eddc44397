"""The cheap rivals that users know: SeqSLAM's contrast, the ratio test, SUE's spread."""

import numpy as np
import numpy.typing as npt

from surefix.baselines.distances import (
    Distances,
    Floats,
    checked_window,
    nearest,
    nearest_elsewhere,
    number,
    whole,
)
from surefix.errors import mismatch
from surefix.matches import Matches

__all__ = ["enhance_contrast", "ratio_test", "spread"]

CELLS_AT_ONCE = 1 << 21


def enhance_contrast(D: Distances, window: int = 10) -> Distances:
    """How far each distance lies below its neighbourhood on the map, in standard deviations of that
    neighbourhood.

    ``(D[i, j] - mean) / std`` over the places ``i - window // 2`` to ``i + window // 2`` of the
    same query, so that a place must stand out from the places around it: the contrast enhancement
    of Milford and Wyeth, *SeqSLAM*, ICRA 2012. As in OpenSeqSLAM, the place itself belongs to its
    neighbourhood, the neighbourhood is cut off at both ends of the route, and the standard
    deviation is the sample's (over one less than the places). OpenSeqSLAM then shifts the matrix so
    that its least value is 0, which changes no match and no curve and is left out here. If all
    distances of a neighbourhood are equal, the result is 0: the place does not stand out.

    Parameters
    ----------
    D : array of float32, shape (n, m)
    window : int
        In places, 2 or more; 10 in OpenSeqSLAM.

    Returns
    -------
    array of float32, shape (n, m)
        No unit; negative if a place is more alike than those around it. The same for ``a * D +
        b``, ``a > 0``.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix import baselines
    >>> D = np.array([[5], [5], [2], [5], [5], [5]], np.float32)
    >>> baselines.enhance_contrast(D, window=2)[:, 0].round(2)
    array([ 0.  ,  0.58, -1.15,  0.58,  0.  ,  0.  ], dtype=float32)
    """
    half = whole("contrast", window, 2) // 2
    nearest(D)
    D = np.asarray(D)
    places, queries = D.shape
    enhanced = np.empty((places, queries), np.float32)
    columns = max(1, CELLS_AT_ONCE // places)
    for first in range(0, queries, columns):
        part = slice(first, first + columns)
        enhanced[:, part] = _standardise(D[:, part], min(half, places - 1))
    return enhanced


def _standardise(D: Distances, half: int) -> Distances:
    """Whole columns, in two passes over each neighbourhood: a flat one has exactly no spread."""
    values = D.astype(np.float64)
    places = len(values)
    each = np.arange(places)
    count = (np.minimum(each + half, places - 1) - np.maximum(each - half, 0) + 1)[:, None]
    # Row i of values[there] is the place i + step, for the rows [here] that have one.
    around = [
        (slice(max(0, -s), places - max(0, s)), slice(max(0, s), places - max(0, -s)))
        for s in range(-half, half + 1)
    ]

    mean = np.zeros_like(values)
    for here, there in around:
        mean[here] += values[there]
    mean /= count
    variance = np.zeros_like(values)
    for here, there in around:
        variance[here] += (values[there] - mean[here]) ** 2
    std = np.sqrt(variance / (count - 1))

    enhanced = np.divide(values - mean, std, out=np.zeros_like(values), where=std > 0)
    return np.asarray(enhanced, np.float32)


def ratio_test(D: Distances, *, exclude: int = 1) -> Matches:
    """The place of least distance, scored by its ratio to the least distance elsewhere.

    Also known as the perceptual-aliasing score (PA-score) among the estimates of uncertainty in
    visual place recognition, there with ``exclude=0`` (Zaffar, Nan and Kooij, CVPR 2024), and, with
    a window, as SeqSLAM's uniqueness. Along a route the frames beside the best look like it, so by
    default it is not compared to them.

    A ratio needs distances of 0 and more. If the matrix holds a negative one (a negated
    similarity, or a cosine distance rounded below 0), its least value is subtracted from all of it
    first: such scores depend on the whole matrix.

    Parameters
    ----------
    D : array of float32, shape (n, m)
    exclude : int
        Places within this many of the best are not elsewhere: 1 by default, the usual tolerance; 0
        is the PA-score.

    Returns
    -------
    Matches
        Scored from 0 (nothing else is near) to 1 (another place is as good; also if both
        distances are 0).

    Examples
    --------
    >>> import numpy as np
    >>> from surefix import baselines
    >>> D = np.array([[0.25], [0.3125], [0.75], [0.5], [1.0]], np.float32)
    >>> baselines.ratio_test(D).score, baselines.ratio_test(D, exclude=0).score
    (array([0.5], dtype=float32), array([0.8], dtype=float32))
    """
    place, distance = nearest(D)
    D = np.asarray(D)
    exclude = checked_window(exclude, len(D))
    below_zero = min(0.0, float(D.min(initial=0.0)))
    best = distance.astype(np.float64) - below_zero
    elsewhere = nearest_elsewhere(D, place, exclude) - below_zero
    score = np.divide(best, elsewhere, out=np.ones_like(best), where=elsewhere > 0)
    return Matches(place=place, score=score)


def spread(
    D: Distances,
    positions: npt.ArrayLike | None = None,
    *,
    top: int = 10,
    slope: float = 350.0,
    reach: float = 500.0,
) -> Matches:
    """The place of least distance, scored by the spread of the positions of the ``top`` nearest
    places.

    Spatial uncertainty estimation (SUE): Zaffar, Nan and Kooij, *On the Estimation of
    Image-matching Uncertainty in Visual Place Recognition*, CVPR 2024. The ``top`` places of a
    query get weights that sum to 1, proportional to ``exp(-slope * distance)``. The score is the
    root of the weighted variance of their positions about the weighted mean, averaged over the axes
    (the authors' score is its square: the same order, and so the same curve). As in their code,
    ``top`` is 10, ``slope`` 350, and no place counts as further than ``reach`` from the mean on an
    axis. Their code limits only the one direction of an axis; here it is both, as its comment says.

    The slope is per unit of distance, and its effect depends on that unit: near 0 all ``top``
    places weigh the same, and with a large one only the best counts, so that every score is 0.

    Parameters
    ----------
    D : array of float32, shape (n, m)
    positions : array, shape (n,) or (n, k), optional
        Of the places, in planar metres, not degrees. By default their index on the route.
    top : int
        How many places, 2 or more; all of them if the map has fewer.
    slope : float
        Per unit of distance, 0 or more.
    reach : float
        In the unit of ``positions``, 0 or more.

    Returns
    -------
    Matches
        Scored by the spread in the unit of ``positions``.

    Raises
    ------
    SurefixValueError
        As for ``single_frame``, for positions of another length or that are not finite, and for an
        option outside its range.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix import baselines
    >>> D = np.array([[0.1, 0.1], [0.1, 0.9], [0.9, 0.9], [0.9, 0.1]], np.float32)
    >>> baselines.spread(D, top=2).score
    array([0.5, 1.5], dtype=float32)
    """
    place, _ = nearest(D)
    D = np.asarray(D)
    top = min(whole("top", top, 2), len(D))
    slope, reach = number("slope", slope, 0.0), number("reach", reach, 0.0)
    where = _checked(np.arange(len(D)) if positions is None else positions, len(D))
    variance = np.zeros(D.shape[1])
    for query in range(D.shape[1]):
        distances = D[:, query].astype(np.float64)
        candidates = np.argsort(distances, kind="stable")[:top]
        # From the best on, which leaves the weights as they are and keeps them from vanishing all
        # together.
        weights = np.exp(-slope * (distances[candidates] - distances[candidates[0]]))
        weights /= weights.sum()
        offsets = where[candidates] - weights @ where[candidates]
        variance[query] = (weights @ np.minimum(np.abs(offsets), reach) ** 2).mean()
    return Matches(place=place, score=np.sqrt(variance).astype(np.float32))


def _checked(positions: npt.ArrayLike, places: int) -> Floats:
    """Positions as (n, k)."""
    try:
        where = np.asarray(positions, np.float64)
    except (TypeError, ValueError):
        raise mismatch("positions", "numbers", type(positions).__name__) from None
    if where.ndim not in (1, 2) or len(where) != places or where.size == 0:
        shapes = f"one position a place, ({places},) or ({places}, k)"
        raise mismatch("positions", shapes, f"the shape {where.shape}")
    where = where.reshape(places, -1)
    if not np.isfinite(where).all():
        row = int(np.argmin(np.isfinite(where).all(axis=1)))
        raise mismatch("positions", "finite numbers", f"{where[row].tolist()} at place {row}")
    return where
