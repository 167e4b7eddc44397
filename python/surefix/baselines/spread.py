"""SUE: how far apart on the map the places lie that look most alike."""

import numpy as np
import numpy.typing as npt

from surefix.baselines.distances import Distances, Floats, nearest
from surefix.baselines.options import number, whole
from surefix.errors import SurefixValueError
from surefix.matches import Matches

__all__ = ["spread"]


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

    The slope is per unit of distance, and what it does depends on that unit: near 0 all ``top``
    places weigh the same, and with a large one only the best counts, so that every score is 0.

    Parameters
    ----------
    D : array of float32, shape (n, m)
    positions : array, shape (n,) or (n, k), optional
        Where each place is, in planar metres, not degrees. By default its index on the route.
    top : int
        How many places, 2 or more; all of them where the map has fewer.
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
    where = (
        np.arange(len(D), dtype=np.float64)[:, None]
        if positions is None
        else checked(positions, len(D))
    )

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


def checked(positions: npt.ArrayLike, places: int) -> Floats:
    """Positions as (n, k)."""
    try:
        where = np.asarray(positions, np.float64)
    except (TypeError, ValueError):
        raise SurefixValueError(
            f"positions: expected numbers, got {type(positions).__name__}"
        ) from None
    if where.ndim not in (1, 2) or len(where) != places or where.size == 0:
        shapes = f"one position a place, ({places},) or ({places}, k)"
        raise SurefixValueError(f"positions: expected {shapes}, got the shape {where.shape}")
    where = where.reshape(places, -1)
    if not np.isfinite(where).all():
        row = int(np.argmin(np.isfinite(where).all(axis=1)))
        raise SurefixValueError(
            f"positions: expected finite numbers, got {where[row].tolist()} at place {row}"
        )
    return where
