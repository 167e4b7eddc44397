"""Along the route: where matches were right, and where they were trusted."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from surefix.plot.theme import LIGHT, Theme

__all__ = ["Band", "route_strip"]

PITCH = 1.16

Band = tuple[str, NDArray[np.bool_], NDArray[np.bool_]]
"""A name; which queries' matches are right; and which queries are shown at all. Both of shape
(m,)."""


def route_strip(
    ax: Axes,
    positions: NDArray[np.float64],
    bands: Sequence[Band],
    *,
    gap: tuple[float, float] | None = None,
    along: str = "position along the route (m)",
    unit: str = "m",
    theme: Theme = LIGHT,
) -> Axes:
    """Draws a band for each way of matching: right upwards, wrong downwards, nothing where none is
    shown.

    Parameters
    ----------
    positions : array of float, shape (m,)
        How far along the route each query was taken, ascending.
    bands : sequence of (name, right, shown)
        From the top down.
    gap : (from, to), optional
        A stretch to bracket under the last band: the longest without a right fix in it.
    along, unit : str
        What ``positions`` are, the name of the axis; and the unit of the stretch.
    """
    middles = (positions[:-1] + positions[1:]) / 2
    edges = np.concatenate((positions[:1], middles, positions[-1:]))
    if edges[0] == edges[-1]:
        # A single query, or a robot that never moved.
        edges = edges[0] + np.linspace(-0.5, 0.5, len(edges))
    first, last = float(edges[0]), float(edges[-1])
    for row, (name, right, shown) in enumerate(bands):
        middle = -row * PITCH
        for mask, height, colour in (
            (right & shown, 0.36, theme.trusted_right),
            (~right & shown, -0.36, theme.trusted_wrong),
        ):
            spans = _spans(edges, mask)
            ax.broken_barh(spans, (middle, height), facecolors=colour, linewidth=0)
        ax.axhline(middle, color=theme.muted, linewidth=0.7)
        share = f"{int((right & shown).sum())} right, {int((~right & shown).sum())} wrong"
        ax.text(
            first,
            middle + 0.42,
            f"{name}: {share}",
            va="bottom",
            ha="left",
            fontsize=9.5,
            color=theme.ink,
        )
    bottom = -(len(bands) - 1) * PITCH - 0.5
    if gap is not None:
        start, stop = gap
        level = bottom - 0.05
        bracket = {
            "arrowstyle": "|-|,widthA=0.25,widthB=0.25",
            "color": theme.ink,
            "shrinkA": 0,
            "shrinkB": 0,
        }
        ax.annotate("", (start, level), (stop, level), arrowprops=bracket)
        left = (start + stop) / 2 < (first + last) / 2
        ax.text(
            start if left else stop,
            level - 0.1,
            f"longest stretch without a right one: {stop - start:.0f} {unit}",
            ha="left" if left else "right",
            va="top",
            fontsize=8.5,
            color=theme.ink,
        )
        bottom -= 0.45
    ax.set_xlim(first, last)
    ax.set_ylim(bottom, 0.66)
    ax.set_yticks([])
    ax.spines["left"].set_visible(False)
    ax.set_xlabel(f"{along};  up: right,  down: wrong,  empty: none accepted")
    return ax


def _spans(edges: NDArray[np.float64], mask: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Start and length of each run of queries that are set: one piece, so that no seam looks like a
    gap.
    """
    turns = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False]))))
    return [(float(edges[a]), float(edges[b] - edges[a])) for a, b in turns.reshape(-1, 2)]
