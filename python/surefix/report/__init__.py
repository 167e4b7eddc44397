"""Pictures and pages of results: distance matrices, precision-recall curves, montages. Drawn with matplotlib.

Each picture is a function that takes a matplotlib axis, draws on it and returns it.
"""

try:
    import matplotlib as _matplotlib  # noqa: F401
except ModuleNotFoundError as error:
    if error.name != "matplotlib":
        raise
    message = "surefix.report draws with matplotlib, which is not installed: pip install 'surefix[plot]'"
    raise ModuleNotFoundError(message, name="matplotlib") from None

from surefix.report.curves import precision_recall
from surefix.report.matrix import busiest_window, distance_matrix
from surefix.report.montage import Column, Pair, montage
from surefix.report.outcome import Outcome, is_right, outcomes
from surefix.report.strip import route_strip
from surefix.report.theme import DARK, LIGHT, Theme, png

__all__ = [
    "DARK",
    "LIGHT",
    "Column",
    "Outcome",
    "Pair",
    "Theme",
    "busiest_window",
    "distance_matrix",
    "is_right",
    "montage",
    "outcomes",
    "png",
    "precision_recall",
    "route_strip",
]
