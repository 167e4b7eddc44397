"""One query at a time: by the distance, masked by a prediction, or by the gradient."""

from surefix._core import match_distances
from surefix.baselines.distances import Distances, Flags, nearest
from surefix.matches import Matches

__all__ = ["masked_single_frame", "maximum_gradient", "single_frame"]


def single_frame(D: Distances) -> Matches:
    """The place of least distance; the paper's single-frame baseline.

    Parameters
    ----------
    D : array of float32, shape (n, m)
        ``D[i, j]`` is the distance between place ``i`` and query ``j``; less is more alike. As in
        every method here.

    Returns
    -------
    Matches
        Scored by the least distance, in its own unit. Ties go to the lowest place.

    Raises
    ------
    SurefixValueError
        For another shape or type, a NaN or an infinity (the error says where), or fewer than two
        places.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix import baselines
    >>> baselines.single_frame(1 - np.eye(4, dtype=np.float32)).place
    array([0, 1, 2, 3])
    """
    place, distance = nearest(D)
    return Matches(place=place, score=distance)


def masked_single_frame(
    D: Distances,
    *,
    tolerance: int = 1,
    smoothing: int = 3,
    gradient: str = "halved",
    trusted: Flags | list[bool] | None = None,
) -> Matches:
    """The single frame, with the matches refused that are not trusted (Carson, Ford and Milford,
    ICRA 2023).

    Parameters
    ----------
    D : array of float32, shape (n, m)
    tolerance : int
        How many places apart the least distance and the greatest gradient may lie and still agree.
    smoothing, gradient
        How the gradient is made, as for ``surefix.Matcher``.
    trusted : array of bool, shape (m,), optional
        Another predictor's words in place of that consensus.

    Returns
    -------
    Matches
        Those of ``single_frame``; ``accepted`` are the trusted ones.

    Raises
    ------
    SurefixValueError
        As for ``single_frame``, and for an option outside its range or flags of another length or
        type.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix import baselines
    >>> D = 1 - np.eye(4, dtype=np.float32)
    >>> baselines.masked_single_frame(D, trusted=[True, False, True, True]).accepted
    array([ True, False,  True,  True])
    """
    run = match_distances(
        D,
        sequence_length=1,
        tolerance=tolerance,
        smoothing=smoothing,
        gradient=gradient,
        trusted=trusted,
    )
    return Matches(place=run.single_place, score=run.single_distance, accepted=run.trusted)


def maximum_gradient(D: Distances, *, smoothing: int = 3, gradient: str = "halved") -> Matches:
    """The place of the greatest enhanced gradient (Eqs. 1 and 2): the other half of the consensus
    on its own.

    Parameters
    ----------
    D : array of float32, shape (n, m)
    smoothing, gradient
        How the gradient is made, as for ``surefix.Matcher``.

    Returns
    -------
    Matches
        Scored by minus the gradient there, in the unit of the distances.

    Raises
    ------
    SurefixValueError
        As for ``single_frame``, and for an option outside its range.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix import baselines
    >>> baselines.maximum_gradient(1 - np.eye(5, dtype=np.float32)).place
    array([0, 1, 2, 3, 4])
    """
    run = match_distances(D, sequence_length=1, smoothing=smoothing, gradient=gradient)
    return Matches(place=run.gradient_place, score=-run.gradient_value)
