"""The ratio test: how much better the best place is than the best elsewhere."""

import numpy as np

from surefix.baselines.distances import Distances, checked_window, nearest, nearest_elsewhere
from surefix.matches import Matches

__all__ = ["ratio_test"]


def ratio_test(D: Distances, *, exclude: int = 1) -> Matches:
    """The place of least distance, scored by its ratio to the least distance elsewhere.

    Also known as the perceptual-aliasing score (PA-score) among the estimates of uncertainty in
    visual place recognition, there with ``exclude=0`` (Zaffar, Nan and Kooij, CVPR 2024), and, with
    a window, as SeqSLAM's uniqueness. Along a route the frames beside the best look like it, so by
    default they are not what it is compared to.

    A ratio needs distances of 0 and more. Where the matrix holds a negative one (a negated
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
        Scored from 0 (nothing else is near) to 1 (another place is as good; also where both
        distances are 0).

    Raises
    ------
    SurefixValueError
        As for ``single_frame``, and for a window that leaves nothing elsewhere on the map.

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
    return Matches(
        place=place, score=np.divide(best, elsewhere, out=np.ones_like(best), where=elsewhere > 0)
    )
