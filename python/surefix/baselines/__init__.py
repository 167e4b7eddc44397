"""The methods that the paper compares itself to, and the cheap rivals that users know, on ready
distances.

Each takes distances ``D``, float32 of shape (n places, m queries), less is more alike, and gives a
``surefix.Matches``, which ``surefix.evaluate`` turns into a curve. ``METHODS`` has them all by
name.
"""

from surefix.baselines.contrast import enhance_contrast
from surefix.baselines.methods import METHODS, Context, Method, run_method
from surefix.baselines.predictors import noisy_predictor, perfect_predictor
from surefix.baselines.ratio import ratio_test
from surefix.baselines.sequence import plain_sequence, weighted_sequence
from surefix.baselines.single import masked_single_frame, maximum_gradient, single_frame
from surefix.baselines.spread import spread
from surefix.baselines.supervised import SupervisedPredictor, integrity_factors

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
    "weighted_sequence",
]
