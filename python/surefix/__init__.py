"""Where am I on this route, and may I trust that answer?

surefix matches the images of a drive to those of an earlier drive along the same route, and says of
each match whether to trust it: Carson, Ford and Milford, *Unsupervised Quality Prediction for
Improved Single-Frame and Weighted Sequential Visual Place Recognition*, ICRA 2023. No training, no
ground truth, any descriptor.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from surefix._core import (
    Alarm,
    Alignment,
    Evaluation,
    Fix,
    FixStream,
    Localizer,
    LoopCloser,
    LoopClosure,
    Map,
    MapTraverse,
    Matcher,
    Peak,
    Position,
    Run,
    Sad,
    Segment,
    Segments,
    Sequence,
    Settings,
    Single,
    Threshold,
    Track,
    Trust,
    __version__,
    align,
    calibrate,
    evaluate,
    evaluate_trust,
    find_images,
    match,
    match_distances,
    max_pixels,
    read_image,
    recall_at,
    set_max_pixels,
)
from surefix.auditing import Audit, Estimate, audit
from surefix.comparing import compare
from surefix.comparison import Compared, Comparison
from surefix.contradicting import Contradiction, contradictions
from surefix.errors import SurefixError, SurefixFileError, SurefixValueError
from surefix.matches import Matches
from surefix.motion import Motion
from surefix.tuning import Trial, Tuned, tune

__all__ = [
    "Alarm",
    "Alignment",
    "Audit",
    "Compared",
    "Comparison",
    "Contradiction",
    "Estimate",
    "Evaluation",
    "Fix",
    "FixStream",
    "Localizer",
    "LoopCloser",
    "LoopClosure",
    "Map",
    "MapTraverse",
    "Matcher",
    "Matches",
    "Motion",
    "Peak",
    "Position",
    "Run",
    "Sad",
    "Segment",
    "Segments",
    "Sequence",
    "Settings",
    "Single",
    "SurefixError",
    "SurefixFileError",
    "SurefixValueError",
    "Threshold",
    "Track",
    "Trial",
    "Trust",
    "Tuned",
    "__version__",
    "align",
    "audit",
    "calibrate",
    "compare",
    "contradictions",
    "evaluate",
    "evaluate_trust",
    "find_images",
    "match",
    "match_distances",
    "max_pixels",
    "read_image",
    "recall_at",
    "set_max_pixels",
    "tune",
]

if TYPE_CHECKING:
    from surefix import baselines as baselines
    from surefix import datasets as datasets
    from surefix import descriptors as descriptors
    from surefix import distributed as distributed
    from surefix import frames as frames
    from surefix import live as live
    from surefix import plot as plot
    from surefix import post as post
    from surefix import simulate as simulate
else:
    # Imported on use: some take long, or need optional packages.
    _PARTS = (
        *("baselines", "datasets", "descriptors", "distributed", "frames"),
        *("live", "plot", "post", "simulate"),
    )

    def __getattr__(name):
        if name in _PARTS:
            return import_module(f"surefix.{name}")
        raise AttributeError(f"module 'surefix' has no attribute {name!r}")

    def __dir__():
        return sorted({*globals(), *_PARTS})
