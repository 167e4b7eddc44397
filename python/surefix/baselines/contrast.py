"""SeqSLAM's local contrast enhancement of distances."""

import numpy as np

from surefix.baselines.distances import Distances, nearest
from surefix.baselines.options import whole

__all__ = ["enhance_contrast"]

CELLS_AT_ONCE = 1 << 21


def enhance_contrast(D: Distances, window: int = 10) -> Distances:
    """How far each distance lies below its neighbourhood on the map, in standard deviations of that
    neighbourhood.

    ``(D[i, j] - mean) / std`` over the places ``i - window // 2`` to ``i + window // 2`` of the
    same query, so that a place must stand out from the places around it: the contrast enhancement
    of Milford and Wyeth, *SeqSLAM*, ICRA 2012. As in OpenSeqSLAM, the place itself belongs to its
    neighbourhood, the neighbourhood is cut off at both ends of the route, and the standard
    deviation is the sample's (over one less than the places). OpenSeqSLAM then shifts the matrix so
    that its least value is 0, which changes no match and no curve and is left out here. Where all
    distances of a neighbourhood are equal, the result is 0: the place does not stand out.

    Parameters
    ----------
    D : array of float32, shape (n, m)
    window : int
        In places, 2 or more; 10 in OpenSeqSLAM.

    Returns
    -------
    array of float32, shape (n, m)
        No unit; negative where a place is more alike than those around it. The same for ``a * D +
        b``, ``a > 0``.

    Raises
    ------
    SurefixValueError
        As for ``single_frame``, and for a window of fewer than 2 places.

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
        enhanced[:, first : first + columns] = standardise(
            D[:, first : first + columns], min(half, places - 1)
        )
    return enhanced


def standardise(D: Distances, half: int) -> Distances:
    """Whole columns at a time, in two passes over each neighbourhood, so that a flat one has
    exactly no spread.
    """
    values = D.astype(np.float64)
    places = len(values)
    each = np.arange(places)
    count = (np.minimum(each + half, places - 1) - np.maximum(each - half, 0) + 1)[:, None]
    # Row i of values[there] is the place i + step, for the rows [here] that have one.
    around = [
        (slice(max(0, -s), places - max(0, s)), slice(max(0, s), places - max(0, -s)))
        for s in span(half)
    ]

    mean = np.zeros_like(values)
    for here, there in around:
        mean[here] += values[there]
    mean /= count
    variance = np.zeros_like(values)
    for here, there in around:
        variance[here] += (values[there] - mean[here]) ** 2
    std = np.sqrt(variance / (count - 1))

    enhanced: Distances = np.divide(
        values - mean, std, out=np.zeros_like(values), where=std > 0
    ).astype(np.float32)
    return enhanced


def span(half: int) -> range:
    """The steps from a place to the places of its neighbourhood."""
    return range(-half, half + 1)
