"""Precision-recall curves as a picture."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes

from surefix import Evaluation
from surefix.plot.lines import looks
from surefix.plot.theme import LIGHT, Theme

__all__ = ["precision_recall"]


def precision_recall(
    ax: Axes,
    curves: Mapping[str, Evaluation],
    *,
    trusted: tuple[float, float] | None = None,
    trusted_name: str = "the trusted fixes alone",
    upto: float = 0.2,
    recall: str = "correct",
    theme: Theme = LIGHT,
) -> Axes:
    """Draws curves from the best score to the worst, each with its area up to a recall.

    Parameters
    ----------
    curves : mapping of a name to an ``Evaluation``
        Up to eight; the first is drawn boldest.
    trusted : (recall, precision), optional
        The point that accepts just the trusted fixes: a star.
    trusted_name : str
        What the legend calls it.
    upto : float
        The areas named in the legend are up to this recall; it is shaded.
    recall : {"correct", "place_exists", "rejected"}
        The convention that the curves were made with: it names the axis.

    Raises
    ------
    SurefixValueError
        For more than eight curves: they could not be told apart.
    """
    share = {
        "correct": "share of the correct matches that are accepted",
        "place_exists": "share of the queries on the map",
        "rejected": "share of correct and of rejected matches",
    }[recall]
    ax.axvspan(0, upto, color=theme.grid, alpha=0.55, linewidth=0)
    for layer, ((name, curve), look) in enumerate(
        zip(curves.items(), looks(theme, len(curves)), strict=True)
    ):
        label = f"{name}: area up to recall {upto:g} is {curve.auc(upto):.2f}"
        if curve.max_recall < upto:
            label += f", it ends at recall {curve.max_recall:.2f}"
        # Where nothing was accepted there is no line, but its name stays in the legend.
        ax.plot(
            np.concatenate(([0.0], curve.recall)) if len(curve.recall) else [],
            np.concatenate((curve.precision[:1], curve.precision)),
            label=label,
            **look.line(len(curve.recall) + 1, layer),
        )
    if trusted is not None:
        ax.plot(
            *trusted,
            linestyle="none",
            marker="*",
            markersize=15,
            color=theme.ink,
            markeredgecolor=theme.paper,
            zorder=6,
            clip_on=False,
            label=f"{trusted_name}: precision {trusted[1]:.3f}, recall {trusted[0]:.2f}",
        )
    ax.set_xlim(0, 1)
    ax.set_ylim(0, 1)
    ax.set_xlabel(f"recall ({share})")
    ax.set_ylabel("precision (share of the accepted that are correct)")
    ax.grid(linewidth=0.8)
    ax.set_axisbelow(True)
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1.0), alignment="left", handlelength=2.6)
    return ax
