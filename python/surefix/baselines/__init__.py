"""The methods that the paper compares itself to, and the cheap rivals that users know, on ready
distances.

Each takes distances ``D``, float32 of shape (n places, m queries), less is more alike, and gives a
``surefix.Matches``, which ``surefix.evaluate`` turns into a curve. ``METHODS`` has them all by
name.

All raise ``SurefixValueError`` for distances of another shape or type, a NaN or an infinity (the
error says at which place and query), fewer than two places, and an option outside its range.
"""

from surefix.baselines.filters import topological, track
from surefix.baselines.matching import (
    masked_single_frame,
    maximum_gradient,
    plain_sequence,
    single_frame,
    weighted_sequence,
)
from surefix.baselines.methods import METHODS, Context, Method, run_method
from surefix.baselines.predictors import (
    SupervisedPredictor,
    integrity_factors,
    noisy_predictor,
    perfect_predictor,
)
from surefix.baselines.rivals import enhance_contrast, ratio_test, spread

__all__ = [
    "METHODS",
    "Context",
    "Method",
    "SupervisedPredictor",
    "enhance_contrast",
    "integrity_factors",
    "masked_single_frame",
    "maximum_gradient",
    "noisy_predictor",
    "perfect_predictor",
    "plain_sequence",
    "ratio_test",
    "run_method",
    "single_frame",
    "spread",
    "topological",
    "track",
    "weighted_sequence",
]
