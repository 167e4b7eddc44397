"""What the tracker believes along a drive: its confidence, and whether the robot is off the map."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from surefix.plot.axes import end_at_tick, on_axes
from surefix.plot.bars import spans
from surefix.plot.theme import LIGHT, Theme

__all__ = ["confidence"]


@on_axes(9, 3)
def confidence(
    confidence: NDArray[np.float64],
    off_map: NDArray[np.float64],
    right: NDArray[np.bool_] | None = None,
    *,
    stretches: Sequence[tuple[str, range]] = (),
    accept: float = 0.95,
    ax: Axes | None = None,
    theme: Theme = LIGHT,
) -> Axes:
    """Draws the tracker's confidence and its belief to be off the map, over the queries; below
    them, which places are right, if that is known.

    Parameters
    ----------
    confidence, off_map : array of float, shape (m,)
        As of ``surefix.Run``.
    right : array of bool, shape (m,), optional
        Which places of the tracker are right.
    stretches : sequence of (name, queries)
        Stretches of the drive to shade, as one off the map.
    accept : float
        A confidence to mark by a dashed line.
    ax : Axes, optional
        Where to draw; by default a new figure.
    """
    assert ax is not None
    m = len(confidence)
    edges = np.arange(m + 1, dtype=np.float64) - 0.5
    for name, queries in stretches:
        ax.axvspan(queries.start - 0.5, queries.stop - 0.5, color=theme.grid, linewidth=0)
        middle = (queries.start + queries.stop - 1) / 2
        ax.text(middle, 1.06, name, ha="center", va="bottom", fontsize=9, color=theme.ink)
    ax.plot(confidence, color=theme.trusted_right, linewidth=1.3, label="confidence", zorder=3)
    ax.fill_between(np.arange(m), confidence, color=theme.trusted_right, alpha=0.18, linewidth=0)
    off: Any = {"color": theme.trusted_wrong, "linewidth": 1.5, "linestyle": (0, (4, 1.5))}
    ax.plot(off_map, label="belief to be off the map", zorder=4, **off)
    ax.axhline(accept, color=theme.muted, linewidth=0.9, linestyle=(0, (1, 2)), zorder=2)
    if right is not None:
        for mask, low, colour in (
            (right, -0.12, theme.trusted_right),
            (~right, -0.22, theme.trusted_wrong),
        ):
            ax.broken_barh(spans(edges, mask), (low, 0.08), facecolors=colour, linewidth=0)
        ax.text(m, -0.08, " right", va="center", fontsize=8.5, color=theme.ink)
        ax.text(m, -0.18, " wrong", va="center", fontsize=8.5, color=theme.ink)
    end_at_tick(ax.xaxis, -0.5, m - 0.5)
    ax.set_ylim(-0.03 if right is None else -0.25, 1.03)
    ax.set_yticks([0, 0.5, 1])
    ax.set_xlabel("query (frame)")
    ax.set_ylabel("belief")
    ax.legend(loc="lower right", bbox_to_anchor=(1, 1.12), ncols=2, borderaxespad=0)
    return ax
