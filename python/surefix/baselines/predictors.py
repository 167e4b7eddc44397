"""Predictors that know the answer: the best there can be, and one with set rates of error."""

import numpy as np

from surefix.baselines.distances import Distances, Flags, nearest
from surefix.baselines.options import number
from surefix.baselines.truth import Truth, right_matches
from surefix.errors import SurefixValueError

__all__ = ["noisy_predictor", "perfect_predictor"]


def perfect_predictor(D: Distances, truth: Truth, tolerance: float = 1) -> Flags:
    """Is each single-frame match right? The bound on what any predictor can do, as a mask or as
    weights.

    Parameters
    ----------
    D : array of float32, shape (n, m)
    truth : array or pair of arrays
        As for ``surefix.evaluate``: a place a query, -1 where there is none; a matrix (n, m); or a
        pair of positions.
    tolerance : float
        How far from the truth is still right: places, or metres where the truth is positions.

    Returns
    -------
    array of bool, shape (m,)
        False also where the truth does not say.

    Raises
    ------
    SurefixValueError
        As for ``single_frame``, and for a truth of another shape or type.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix import baselines
    >>> baselines.perfect_predictor(1 - np.eye(4, dtype=np.float32), [0, 2, -1, 0])
    array([ True,  True, False, False])
    """
    place, _ = nearest(D)
    right, _ = right_matches(place, len(np.asarray(D)), truth, tolerance)
    return right


def noisy_predictor(
    right: Flags | list[bool],
    *,
    true_positive_rate: float,
    false_positive_rate: float,
    seed: int = 0,
) -> Flags:
    """A predictor with set rates: how good must one be, for weighting by it to pay?

    The share of right matches that it trusts and the share of wrong ones are the rates themselves,
    to the nearest whole query, and only which ones is drawn. With one seed, a higher rate trusts
    all that a lower one does and more, so that a sweep of rates is smooth.

    Parameters
    ----------
    right : array of bool, shape (m,)
        The truth about each match, as from ``perfect_predictor``.
    true_positive_rate, false_positive_rate : float
        The shares of the right and of the wrong matches that are trusted, from 0 to 1.
    seed : int
        Another seed draws other queries.

    Returns
    -------
    array of bool, shape (m,)

    Raises
    ------
    SurefixValueError
        For flags of another type or shape, or a rate outside 0 to 1.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix import baselines
    >>> right = np.arange(100) < 60
    >>> trusted = baselines.noisy_predictor(right, true_positive_rate=0.8, false_positive_rate=0.1)
    >>> int(trusted[right].sum()), int(trusted[~right].sum())
    (48, 4)
    """
    flags = np.asarray(right)
    if flags.ndim != 1 or (flags.dtype != np.bool_ and flags.size):
        raise SurefixValueError(
            f"right: expected bool, one a query, (m,), got {flags.dtype} {flags.shape}"
        )
    rates = {
        True: number("true_positive_rate", true_positive_rate, 0.0, 1.0),
        False: number("false_positive_rate", false_positive_rate, 0.0, 1.0),
    }
    order = np.random.default_rng(seed).permutation(len(flags))
    trusted = np.zeros(len(flags), bool)
    for kind, rate in rates.items():
        queries = order[flags[order] == kind]
        trusted[queries[: round(rate * len(queries))]] = True
    return trusted
