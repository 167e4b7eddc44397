"""Every figure as a function, which draws on a matplotlib axis and returns it: on ``ax``, or in a
new figure of ``matplotlib.pyplot``.

They take plain data: curves of ``surefix.evaluate``, arrays. A run, an alignment, an evaluation, an
audit and a map draw themselves by their method ``plot``. ``png`` makes a file without a display, as
``.figure.savefig`` does. ``LIGHT`` and ``DARK`` are the papers; nothing in a figure hangs on colour
alone.
"""

try:
    import matplotlib as _matplotlib  # noqa: F401
except ModuleNotFoundError as error:
    # matplotlib brings Pillow, and needs it.
    if error.name not in ("matplotlib", "PIL"):
        raise
    missing = (
        "which is not installed"
        if error.name == "matplotlib"
        else "and that with Pillow, which is not installed"
    )
    message = f"surefix.plot draws with matplotlib, {missing}: pip install 'surefix[plot]'"
    raise ModuleNotFoundError(message, name=error.name) from None

from surefix.plot.bars import (
    Band,
    Estimate,
    auc_intervals,
    estimates,
    false_positives,
    route_strip,
    trust_table,
)
from surefix.plot.belief import confidence
from surefix.plot.curves import (
    ablation,
    execution_time,
    precision_recall,
    reliability,
    weight_sweep,
)
from surefix.plot.images import (
    Column,
    Example,
    Pair,
    examples,
    examples_height,
    montage,
    montage_height,
)
from surefix.plot.matrix import aligned_track, busiest_window, distance_matrix
from surefix.plot.outcome import Outcome, is_right, outcomes
from surefix.plot.plan import plan
from surefix.plot.theme import DARK, LIGHT, Theme, png

__all__ = [
    "DARK",
    "LIGHT",
    "Band",
    "Column",
    "Estimate",
    "Example",
    "Outcome",
    "Pair",
    "Theme",
    "ablation",
    "aligned_track",
    "auc_intervals",
    "busiest_window",
    "confidence",
    "distance_matrix",
    "estimates",
    "examples",
    "examples_height",
    "execution_time",
    "false_positives",
    "is_right",
    "montage",
    "montage_height",
    "outcomes",
    "plan",
    "png",
    "precision_recall",
    "reliability",
    "route_strip",
    "trust_table",
    "weight_sweep",
]
