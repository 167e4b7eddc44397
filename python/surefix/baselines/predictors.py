"""Predictors of which matches to trust: the perfect one, one with set rates of error, and the
supervised one that the paper compares itself to.
"""

from typing import Any, Self

import numpy as np

from surefix._core import match_distances
from surefix.baselines.distances import (
    Distances,
    Flags,
    Floats,
    checked_window,
    nearest,
    nearest_elsewhere,
    number,
)
from surefix.baselines.truth import Truth, right_matches
from surefix.errors import SurefixError, mismatch

__all__ = ["SupervisedPredictor", "integrity_factors", "noisy_predictor", "perfect_predictor"]

# Fewer queries tell nothing about the rest of a route.
SHORTEST_CALIBRATION = 10


def perfect_predictor(D: Distances, truth: Truth, tolerance: float = 1) -> Flags:
    """Is each single-frame match right? The bound of any predictor, as a mask or as weights.

    Parameters
    ----------
    D : array of float32, shape (n, m)
    truth : array or pair of arrays
        As for ``surefix.evaluate``: a place a query, -1 for none; a matrix (n, m); or a
        pair of positions.
    tolerance : float
        The distance from the truth that is still right: places, or metres if the truth is
        positions.

    Returns
    -------
    array of bool, shape (m,)
        False also if the truth does not say.

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
        raise mismatch("right", "bool, one a query, (m,)", f"{flags.dtype} {flags.shape}")
    share_right = number("true_positive_rate", true_positive_rate, 0.0, 1.0)
    share_wrong = number("false_positive_rate", false_positive_rate, 0.0, 1.0)
    order = np.random.default_rng(seed).permutation(len(flags))
    trusted = np.zeros(len(flags), bool)
    for kind, rate in ((True, share_right), (False, share_wrong)):
        queries = order[flags[order] == kind]
        trusted[queries[: round(rate * len(queries))]] = True
    return trusted


def integrity_factors(D: Distances, *, exclude: int = 0, gradient: str = "unhalved") -> Floats:
    """How sharp each query's minimum is, in two numbers.

    Carson, Ford and Milford, *Predicting to Improve: Integrity Measures for Assessing Visual
    Localization Performance*, RA-L 2022; the defaults are those of the authors' code.

    Parameters
    ----------
    D : array of float32, shape (n, m)
    exclude : int
        The second best is looked for more than this many places from the best. 0 by default:
        anywhere but at the best.
    gradient : {"unhalved", "halved"}
        The gradient at the minimum, as for ``surefix.Matcher`` and without smoothing.

    Returns
    -------
    array of float64, shape (m, 2)
        (second best - best) / (worst - best), without a unit and 0 if all distances are equal;
        and the gradient at the minimum, in the unit of the distances.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix import baselines
    >>> baselines.integrity_factors(np.array([[4], [2], [3], [6]], np.float32))
    array([[0.25, 3.  ]])
    """
    run = match_distances(D, sequence_length=1, weight=0.0, smoothing=1, gradient=gradient)
    D, place = np.asarray(D), run.single_place
    best = run.single_distance.astype(np.float64)
    exclude = checked_window(exclude, len(D))

    range_ = D.max(axis=0).astype(np.float64) - best
    lead = nearest_elsewhere(D, place, exclude) - best
    sharpness = np.divide(lead, range_, out=np.zeros_like(best), where=range_ > 0)

    last, queries = len(D) - 1, np.arange(D.shape[1])
    before = D[np.maximum(place - 1, 0), queries] - best
    after = D[np.minimum(place + 1, last), queries] - best
    inside = (place > 0) & (place < last)
    # At an end of the route, one side is the place itself and adds 0.
    slope = (before + after) * np.where(inside & (gradient == "halved"), 0.5, 1.0)
    return np.stack([sharpness, slope], axis=1)


class SupervisedPredictor:
    """A support vector machine that learns from a drive with ground truth which single-frame
    matches to trust.

    Carson, Ford and Milford, RA-L 2022: the two ``integrity_factors``, standardised by the
    calibration's mean and standard deviation, and a support vector machine with a radial kernel (C
    = 1, gamma = 1 / (2 variance), scikit-learn's "scale") and balanced classes. Calibrate with the
    descriptor that is used: the gradient has the unit of its distances. Needs scikit-learn: ``pip
    install 'surefix[eval]'``.

    Parameters
    ----------
    exclude, gradient
        As for ``integrity_factors``.

    Attributes
    ----------
    factors : array of float64, shape (q, 2), or None
        The factors of the calibration's queries, once fitted.
    right : array of bool, shape (q,), or None
        Whether their single-frame matches were right.

    Raises
    ------
    SurefixError
        If scikit-learn is not installed.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix import baselines
    >>> rng = np.random.default_rng(0)
    >>> D = rng.random((60, 60), np.float32) + 0.5
    >>> D[np.arange(40), np.arange(40)] = 0.1
    >>> predictor = baselines.SupervisedPredictor().fit(D, np.arange(60))
    >>> bool(predictor.predict(D)[:40].all())
    True
    """

    def __init__(self, *, exclude: int = 0, gradient: str = "unhalved") -> None:
        self._exclude = exclude
        self._gradient = gradient
        self._machine: Any = _machine()
        self.factors: Floats | None = None
        self.right: Flags | None = None

    def fit(self, D: Distances, truth: Truth, tolerance: float = 1) -> Self:
        """Learn from a calibration pair.

        Parameters
        ----------
        D : array of float32, shape (n, m)
        truth, tolerance
            As for ``perfect_predictor``. A query that the truth ignores is left out; one that has
            no true place is a mistake to learn from.

        Returns
        -------
        SupervisedPredictor
            Itself.

        Raises
        ------
        SurefixValueError
            As for ``perfect_predictor``, for fewer than 10 queries, and if all matches are right
            or all are wrong.
        """
        place, _ = nearest(D)
        right, known = right_matches(place, len(np.asarray(D)), truth, tolerance)
        factors, right = self._factors_of(D)[known], right[known]
        if len(right) < SHORTEST_CALIBRATION:
            expected = f"at least {SHORTEST_CALIBRATION} queries with a known truth"
            raise mismatch("calibration", expected, len(right))
        if right.all() or not right.any():
            expected = "right and wrong single-frame matches to learn from"
            got = f"{int(right.sum())} right and {int((~right).sum())} wrong"
            raise mismatch("calibration", expected, got)
        self._machine = _machine().fit(factors, right)
        self.factors, self.right = factors, right
        return self

    def predict(self, D: Distances) -> Flags:
        """Which single-frame matches to trust, as for ``masked_single_frame`` and
        ``weighted_sequence``.

        Parameters
        ----------
        D : array of float32, shape (n, m)

        Returns
        -------
        array of bool, shape (m,)

        Raises
        ------
        SurefixError
            Before ``fit``.
        """
        if self.factors is None:
            raise SurefixError("SupervisedPredictor: expected fit(distances, truth) before predict")
        factors = self._factors_of(D)
        if not len(factors):
            return np.zeros(0, bool)
        trusted: Flags = self._machine.predict(factors)
        return trusted

    def _factors_of(self, D: Distances) -> Floats:
        return integrity_factors(D, exclude=self._exclude, gradient=self._gradient)


def _machine() -> Any:
    """The support vector machine, not yet fitted."""
    try:
        from sklearn.pipeline import make_pipeline
        from sklearn.preprocessing import StandardScaler
        from sklearn.svm import SVC
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "sklearn":
            raise
        raise SurefixError(
            "the supervised predictor needs scikit-learn, which is not installed: pip install "
            "'surefix[eval]'"
        ) from None
    return make_pipeline(
        StandardScaler(), SVC(kernel="rbf", C=1.0, gamma="scale", class_weight="balanced")
    )
