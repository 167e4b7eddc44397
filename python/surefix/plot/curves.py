"""Lines: precision over recall, the area over an option, the time over the size of the map."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from surefix import Evaluation
from surefix.plot.axes import on_axes
from surefix.plot.theme import LIGHT, Theme, looks
from surefix.study.confidence import Reliability

__all__ = [
    "Swept",
    "ablation",
    "execution_time",
    "finish",
    "precision_recall",
    "reliability",
    "weight_sweep",
]

# Marks the curves of an axis.
CURVE = "precision-recall"

Swept = npt.ArrayLike | tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike]
"""An area for each value of the option; or three: the areas, the low and the high ends of their
intervals."""


@on_axes(6.4, 5.2)
def precision_recall(
    curves: Evaluation | Mapping[str, Evaluation],
    *,
    trusted: tuple[float, float] | None = None,
    trusted_name: str = "the trusted fixes alone",
    upto: float = 0.2,
    recall: str = "correct",
    ax: Axes | None = None,
    theme: Theme = LIGHT,
) -> Axes:
    """Draws curves from the best score to the worst, each with its area up to a recall.

    Parameters
    ----------
    curves : Evaluation, or mapping of a name to an ``Evaluation``
        Up to eight on one axis; the first is drawn boldest.
    trusted : (recall, precision), optional
        The point that accepts just the trusted fixes: a star.
    trusted_name : str
        The star's name in the legend.
    upto : float
        The areas named in the legend are up to this recall; it is shaded.
    recall : {"correct", "place_exists", "rejected"}
        The convention that the curves were made with: it names the axis.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Raises
    ------
    SurefixValueError
        For more than eight curves: they could not be told apart.
    """
    assert ax is not None
    if isinstance(curves, Evaluation):
        curves = {"": curves}
    share = {
        "correct": "share of the correct matches that are accepted",
        "place_exists": "share of the queries on the map",
        "rejected": "share of correct and of rejected matches",
    }[recall]
    # Curves that were drawn before keep their looks.
    before = sum(line.get_gid() == CURVE for line in ax.lines)
    if not before:
        ax.axvspan(0, upto, color=theme.grid, alpha=0.55, linewidth=0)
    styles = looks(theme, before + len(curves))[before:]
    for layer, ((name, curve), look) in enumerate(zip(curves.items(), styles, strict=True), before):
        label = f"area up to recall {upto:g} is {curve.auc(upto):.2f}"
        label = f"{name}: {label}" if name else label
        if curve.max_recall < upto:
            label += f", it ends at recall {curve.max_recall:.2f}"
        # If nothing was accepted there is no line, but its name stays in the legend.
        ax.plot(
            np.concatenate(([0.0], curve.recall)) if len(curve.recall) else [],
            np.concatenate((curve.precision[:1], curve.precision)),
            label=label,
            gid=CURVE,
            **look.line(len(curve.recall) + 1, layer),
        )
    if trusted is not None:
        label = f"{trusted_name}: precision {trusted[1]:.3f}, recall {trusted[0]:.2f}"
        star(ax, trusted, theme.ink, label, theme)
    ax.set_xlim(0, 1)
    ax.set_ylim(0, 1)
    ax.set_xlabel(f"recall ({share})")
    ax.set_ylabel("precision (share of the accepted that are correct)")
    return finish(ax, handlelength=2.6)


@on_axes(5.4, 5.4)
def reliability(
    diagrams: Mapping[str, Reliability], *, ax: Axes | None = None, theme: Theme = LIGHT
) -> Axes:
    """Draws the share of right matches against their confidence, a point a bin, the larger the more
    queries are in it. The line leaves out bins of fewer than five, which are mostly chance.

    Parameters
    ----------
    diagrams : mapping of a name to a ``surefix.study.Reliability``
        Up to eight.
    ax : Axes, optional
        Where to draw; by default a new figure.
    """
    assert ax is not None
    ax.plot((0, 1), (0, 1), color=theme.muted, linewidth=1, zorder=2)
    styles = looks(theme, len(diagrams))
    for layer, ((name, each), look) in enumerate(zip(diagrams.items(), styles, strict=True)):
        line = look.line(len(each.said), layer) | {"marker": ""}
        often = each.count >= 5
        label = f"{name}: off by {each.error:.3f}"
        ax.plot(each.said[often], each.right[often], label=label, **line)
        sizes = 8 + 160 * each.count / max(1, each.count.sum())
        points: Any = {"s": sizes, "color": look.colour, "marker": look.mark or "o"}
        ax.scatter(each.said, each.right, zorder=line["zorder"], clip_on=False, **points)
    ax.set_xlim(0, 1)
    ax.set_ylim(0, 1)
    ax.set_aspect("equal")
    ax.set_xlabel("confidence (mean of a bin)")
    ax.set_ylabel("share that is right")
    return finish(ax, handlelength=2.6)


@on_axes(6.4, 4.8)
def weight_sweep(
    weights: npt.ArrayLike,
    areas: Mapping[str, Swept],
    *,
    upto: float = 0.2,
    ax: Axes | None = None,
    theme: Theme = LIGHT,
) -> Axes:
    """Draws the area under the curve against the weight ``w``, a line for each predictor.

    Parameters
    ----------
    weights : array of float, shape (k,)
        From 0, the unweighted sequence, to 1.
    areas : mapping of a name to an array (k,), or to three: the areas, their low and high ends
        Up to eight; an interval is drawn as a band.
    upto : float
        The areas are up to this recall.
    ax : Axes, optional
        Where to draw; by default a new figure.
    """
    assert ax is not None
    ax.set_xlim(0, 1)
    ax.set_xlabel("weight w (0: unweighted, 1: a trusted match is drawn down to the floor)")
    return _areas(ax, weights, areas, upto, theme)


@on_axes(6.4, 4.8)
def ablation(
    lengths: Sequence[int],
    areas: Mapping[str, Swept],
    *,
    upto: float = 0.2,
    ax: Axes | None = None,
    theme: Theme = LIGHT,
) -> Axes:
    """Draws the area under the curve against the sequence length ``L``, a line for each method.

    Parameters
    ----------
    lengths : sequence of int, k of them
        In queries.
    areas : mapping of a name to an array (k,), or to three: the areas, their low and high ends
        Up to eight; an interval is drawn as a band.
    upto : float
        The areas are up to this recall.
    ax : Axes, optional
        Where to draw; by default a new figure.
    """
    assert ax is not None
    ax.set_xticks(list(lengths))
    ax.set_xlabel("sequence length L (queries)")
    return _areas(ax, lengths, areas, upto, theme)


@on_axes(6.4, 4.8)
def execution_time(
    places: npt.ArrayLike,
    microseconds: Mapping[str, npt.ArrayLike],
    *,
    ax: Axes | None = None,
    theme: Theme = LIGHT,
) -> Axes:
    """Draws the time of a query against the number of places, both on logarithmic scales.

    Parameters
    ----------
    places : array of int, shape (k,)
        The sizes of the map.
    microseconds : mapping of a name to an array of float, shape (k,)
        The mean time of a query, more than 0; up to eight.
    ax : Axes, optional
        Where to draw; by default a new figure.
    """
    assert ax is not None
    _lines(ax, places, microseconds, theme)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlabel("places on the map")
    ax.set_ylabel("mean time for a query (microseconds)")
    return finish(ax, handlelength=3.2)


def star(ax: Axes, at: tuple[float, float], colour: str, label: str, theme: Theme) -> None:
    """One point that stands out."""
    edge: Any = {"markeredgecolor": theme.paper, "zorder": 6, "clip_on": False}
    ax.plot(*at, "*", markersize=15, color=colour, label=label, **edge)


def finish(ax: Axes, **legend: float) -> Axes:
    """A grid below the lines, and the legend above the axes."""
    ax.grid(linewidth=0.8)
    ax.set_axisbelow(True)
    # On axes that were made elsewhere, as their other words are.
    look: Any = {"frameon": False, "labelcolor": ax.xaxis.label.get_color()}
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1.0), alignment="left", **look, **legend)
    return ax


def _areas(
    ax: Axes, at: npt.ArrayLike, areas: Mapping[str, Swept], upto: float, theme: Theme
) -> Axes:
    _lines(ax, at, areas, theme)
    ax.set_ylim(0, 1)
    ax.set_ylabel(f"area under the precision-recall curve up to recall {upto:g}")
    columns = 2 if len(areas) > 4 and max(map(len, areas)) <= 24 else 1
    return finish(ax, handlelength=3.2, ncols=columns)


def _lines(ax: Axes, at: npt.ArrayLike, lines: Mapping[str, Swept], theme: Theme) -> None:
    at = np.asarray(at, np.float64)
    styles = looks(theme, len(lines))
    for layer, ((name, values), look) in enumerate(zip(lines.items(), styles, strict=True)):
        middle, low, high = values if isinstance(values, tuple) else (values, None, None)
        marks = {"marker": look.mark or "o", "markevery": None, "markersize": 4.5}
        ax.plot(at, np.asarray(middle, np.float64), label=name, **look.line(len(at), layer) | marks)
        if low is not None and high is not None:
            ends = np.asarray(low), np.asarray(high)
            ax.fill_between(at, *ends, color=look.colour, alpha=0.13, linewidth=0)
