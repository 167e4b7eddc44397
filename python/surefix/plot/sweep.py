"""The area under the curve against one option: the weight, or the length of the sequence."""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from surefix.plot.lines import looks
from surefix.plot.theme import LIGHT, Theme

__all__ = ["Swept", "ablation", "weight_sweep"]

Swept = npt.ArrayLike | tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike]
"""An area for each value of the option; or that with the low and the high end of its interval:
three of them."""


def weight_sweep(
    ax: Axes,
    weights: npt.ArrayLike,
    areas: Mapping[str, Swept],
    *,
    upto: float = 0.2,
    theme: Theme = LIGHT,
) -> Axes:
    """Draws the area under the curve against the weight ``w``, a line for each predictor.

    Parameters ---------- weights : array of float, shape (k,) From 0, the unweighted sequence, to
    1. areas : mapping of a name to an array (k,), or to a tuple of three: the areas, their low
    ends, their high ends Up to eight; an interval is drawn as a band. upto : float The areas are up
    to this recall.
    """
    _lines(ax, np.asarray(weights, np.float64), areas, theme)
    ax.set_xlim(0, 1)
    ax.set_xlabel("weight w (0: unweighted, 1: a trusted match is drawn down to the floor)")
    return _finish(ax, upto)


def ablation(
    ax: Axes,
    lengths: Sequence[int],
    areas: Mapping[str, Swept],
    *,
    upto: float = 0.2,
    theme: Theme = LIGHT,
) -> Axes:
    """Draws the area under the curve against the sequence length ``L``, a line for each method.

    Parameters ---------- lengths : sequence of int, k of them In queries. areas : mapping of a name
    to an array (k,), or to a tuple of three: the areas, their low ends, their high ends Up to
    eight; an interval is drawn as a band. upto : float The areas are up to this recall.
    """
    _lines(ax, np.asarray(lengths, np.float64), areas, theme)
    ax.set_xticks(list(lengths))
    ax.set_xlabel("sequence length L (queries)")
    return _finish(ax, upto)


def _lines(ax: Axes, at: npt.NDArray[np.float64], areas: Mapping[str, Swept], theme: Theme) -> None:
    for layer, ((name, swept), look) in enumerate(
        zip(areas.items(), looks(theme, len(areas)), strict=True)
    ):
        middle, low, high = swept if isinstance(swept, tuple) else (swept, None, None)
        style = look.line(len(at), layer) | {
            "marker": look.mark or "o",
            "markevery": None,
            "markersize": 4.5,
        }
        ax.plot(at, np.asarray(middle, np.float64), label=name, **style)
        if low is not None and high is not None:
            ax.fill_between(
                at, np.asarray(low), np.asarray(high), color=look.colour, alpha=0.13, linewidth=0
            )


def _finish(ax: Axes, upto: float) -> Axes:
    ax.set_ylim(0, 1)
    ax.set_ylabel(f"area under the precision-recall curve up to recall {upto:g}")
    ax.grid(linewidth=0.8)
    ax.set_axisbelow(True)
    names = ax.get_legend_handles_labels()[1]
    columns = 2 if len(names) > 4 and max(map(len, names)) <= 24 else 1
    ax.legend(
        loc="lower left", bbox_to_anchor=(0, 1.0), alignment="left", handlelength=3.2, ncols=columns
    )
    return ax
