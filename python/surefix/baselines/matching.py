"""The paper's methods on ready distances: single frames and sequences, with or without trust."""

from collections.abc import Sequence
from typing import Any, Unpack

from surefix._core import Segments, match_distances
from surefix.baselines.distances import Distances, Flags, nearest
from surefix.baselines.rivals import enhance_contrast
from surefix.matches import Matches
from surefix.options import Options

__all__ = [
    "masked_single_frame",
    "maximum_gradient",
    "plain_sequence",
    "single_frame",
    "weighted_sequence",
]


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
    D: Distances, *, trusted: Flags | list[bool] | None = None, **options: Unpack[Options]
) -> Matches:
    """The single frame, with the matches refused that are not trusted (Carson, Ford and Milford,
    ICRA 2023).

    Parameters
    ----------
    D : array of float32, shape (n, m)
    trusted : array of bool, shape (m,), optional
        Another predictor's flags in place of the consensus.
    tolerance, smoothing, gradient
        Those of the consensus, as for ``surefix.match_distances``.

    Returns
    -------
    Matches
        Those of ``single_frame``; ``accepted`` are the trusted ones.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix import baselines
    >>> D = 1 - np.eye(4, dtype=np.float32)
    >>> baselines.masked_single_frame(D, trusted=[True, False, True, True]).accepted
    array([ True, False,  True,  True])
    """
    options["sequence_length"] = 1
    run = match_distances(D, trusted=trusted, **options)
    return Matches(place=run.single_place, score=run.single_distance, accepted=run.trusted)


def maximum_gradient(D: Distances, **options: Unpack[Options]) -> Matches:
    """The place of the greatest enhanced gradient (Eqs. 1 and 2): the other half of the consensus
    on its own.

    Parameters
    ----------
    D : array of float32, shape (n, m)
    smoothing, gradient
        As for ``surefix.match_distances``.

    Returns
    -------
    Matches
        Scored by minus the gradient there, in the unit of the distances.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix import baselines
    >>> baselines.maximum_gradient(1 - np.eye(5, dtype=np.float32)).place
    array([0, 1, 2, 3, 4])
    """
    options["sequence_length"] = 1
    run = match_distances(D, **options)
    return Matches(place=run.gradient_place, score=-run.gradient_value)


def plain_sequence(
    D: Distances,
    *,
    sequence_length: int = 2,
    contrast: int | None = None,
    speeds: Sequence[float] = (1.0,),
    segments: Segments | None = None,
) -> Matches:
    """The diagonal of least mean distance (Eqs. 5 and 6 with weight 0): the paper's baseline,
    SeqSLAM-like.

    With ``contrast`` and ``speeds`` it is nearer to SeqSLAM itself (Milford and Wyeth, ICRA 2012):
    the distances are enhanced first, and lines of several slopes are searched. Unlike SeqSLAM's, a
    line ends at the current query, and the score is the line's mean distance, not its ratio to the
    best line elsewhere.

    Parameters
    ----------
    D : array of float32, shape (n, m)
    sequence_length : int
        In queries; 1 is the single frame.
    contrast : int, optional
        The window of ``enhance_contrast``, in places; 10 in OpenSeqSLAM. By default the distances
        stay as they are.
    speeds : sequence of float
        Slopes to search, in places a query.
    segments : Segments, optional
        How the places follow each other: no line crosses a break. (The neighbourhoods of
        ``contrast`` do, as published.)

    Returns
    -------
    Matches
        Scored by the mean distance along the line, in the unit of the distances (none with
        ``contrast``). Not ``ready`` in the first ``sequence_length - 1`` queries, whose place and
        score are the single frame's.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix import baselines
    >>> matches = baselines.plain_sequence(1 - np.eye(5, dtype=np.float32), sequence_length=3)
    >>> matches.ready
    array([False, False,  True,  True,  True])
    """
    D = D if contrast is None else enhance_contrast(D, contrast)
    how: Any = {} if segments is None else {"segments": segments}
    how |= {"sequence_length": sequence_length, "weight": 0.0, "speeds": list(speeds)}
    return weighted_sequence(D, **how)


def weighted_sequence(
    D: Distances, *, trusted: Flags | list[bool] | None = None, **options: Unpack[Options]
) -> Matches:
    """The sequence in which trusted matches draw the diagonal (Carson, Ford and Milford, ICRA 2023,
    Eqs. 4 to 6).

    Parameters
    ----------
    D : array of float32, shape (n, m)
    trusted : array of bool, shape (m,), optional
        Another predictor's flags in place of the consensus.
    sequence_length, weight, floor, tolerance, smoothing, gradient, speeds
        As for ``surefix.match_distances``; its floor, "global", is the paper's own.

    Returns
    -------
    Matches
        Scored by the mean weighted distance along the diagonal, in the unit of the distances. Not
        ``ready`` in the first ``sequence_length - 1`` queries.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix import baselines
    >>> baselines.weighted_sequence(1 - np.eye(5, dtype=np.float32)).place
    array([0, 1, 2, 3, 4])
    """
    run = match_distances(D, trusted=trusted, **options)
    return Matches(place=run.place, score=run.score, ready=run.ready)
