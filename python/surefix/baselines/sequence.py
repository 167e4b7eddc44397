"""Sequences of queries: plain, as in SeqSLAM, or weighted by the trusted matches, as in the
paper.
"""

from collections.abc import Sequence

from surefix._core import match_distances
from surefix.baselines.contrast import enhance_contrast
from surefix.baselines.distances import Distances, Flags
from surefix.matches import Matches

__all__ = ["plain_sequence", "weighted_sequence"]


def plain_sequence(
    D: Distances,
    *,
    sequence_length: int = 2,
    contrast: int | None = None,
    speeds: Sequence[float] = (1.0,),
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
        The window of ``enhance_contrast``, in places; 10 in OpenSeqSLAM. None by default: the
        distances as they are.
    speeds : sequence of float
        Slopes to search, in places a query.

    Returns
    -------
    Matches
        Scored by the mean distance along the line, in the unit of the distances (none with
        ``contrast``). Not ``ready`` in the first ``sequence_length - 1`` queries, where place and
        score are the single frame's.

    Raises
    ------
    SurefixValueError
        As for ``single_frame``, and for an option outside its range.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix import baselines
    >>> matches = baselines.plain_sequence(1 - np.eye(5, dtype=np.float32), sequence_length=3)
    >>> matches.ready
    array([False, False,  True,  True,  True])
    """
    D = D if contrast is None else enhance_contrast(D, contrast)
    return weighted_sequence(D, sequence_length=sequence_length, weight=0.0, speeds=speeds)


def weighted_sequence(
    D: Distances,
    *,
    sequence_length: int = 2,
    weight: float = 0.99,
    floor: str | float = "global",
    trusted: Flags | list[bool] | None = None,
    tolerance: int = 1,
    smoothing: int = 3,
    gradient: str = "halved",
    speeds: Sequence[float] = (1.0,),
) -> Matches:
    """The sequence in which trusted matches draw the diagonal (Carson, Ford and Milford, ICRA 2023,
    Eqs. 4 to 6).

    Parameters
    ----------
    D : array of float32, shape (n, m)
    sequence_length, weight, floor, tolerance, smoothing, gradient, speeds
        As for ``surefix.match_distances``; the floor "global" is the paper's own.
    trusted : array of bool, shape (m,), optional
        Another predictor's words in place of the consensus.

    Returns
    -------
    Matches
        Scored by the mean weighted distance along the diagonal, in the unit of the distances. Not
        ``ready`` in the first ``sequence_length - 1`` queries.

    Raises
    ------
    SurefixValueError
        As for ``single_frame``, and for an option outside its range.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix import baselines
    >>> baselines.weighted_sequence(1 - np.eye(5, dtype=np.float32)).place
    array([0, 1, 2, 3, 4])
    """
    run = match_distances(
        D,
        floor=floor,
        trusted=trusted,
        sequence_length=sequence_length,
        weight=weight,
        tolerance=tolerance,
        smoothing=smoothing,
        gradient=gradient,
        speeds=list(speeds),
    )
    return Matches(place=run.place, score=run.score, ready=run.ready)
