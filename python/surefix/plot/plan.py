"""The plan of a route: its roads from above, and what was found along them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from surefix._core import Segments
from surefix.errors import mismatch
from surefix.plot.axes import on_axes
from surefix.plot.theme import LIGHT, Theme

__all__ = ["plan"]


@on_axes(6.4, 5)
def plan(
    positions: NDArray[np.float64],
    segments: Segments | None = None,
    *,
    place: NDArray[np.int64] | None = None,
    right: NDArray[np.bool_] | None = None,
    names: Sequence[str] = (),
    ax: Axes | None = None,
    theme: Theme = LIGHT,
) -> Axes:
    """Draws a route from above: each segment as a line from its start (a dot), closed ones as
    rings, and links as dotted arrows; on it the places of fixes, right ones as dots and wrong ones
    as crosses.

    Parameters
    ----------
    positions : array, shape (n, 2) or (n, 3)
        Of the places, in metres.
    segments : Segments, optional
        How the places follow each other; in one segment by default.
    place : array of int, shape (m,), optional
        The place of each fix.
    right : array of bool, shape (m,), optional
        Which of them are right; all by default.
    names : sequence of str
        A name for each segment.
    ax : Axes, optional
        Where to draw; by default a new figure.
    """
    assert ax is not None
    positions = np.asarray(positions, np.float64)
    segments = Segments(len(positions)) if segments is None else segments
    if segments.places != len(positions):
        raise mismatch("segments", f"those of {len(positions)} places", segments.places)
    road: Any = {"color": theme.muted, "linewidth": 1.4, "zorder": 2, "solid_capstyle": "round"}
    for index, segment in enumerate(segments):
        rows = np.arange(segment.start, segment.end)
        rows = np.append(rows, segment.start) if segment.closed else rows
        east, north = positions[rows, :2].T
        ax.plot(east, north, **road)
        ax.plot(east[0], north[0], "o", color=theme.muted, markersize=4.5, zorder=2)
        if index < len(names):
            top = rows[np.argmax(north)] if segment.closed else rows[len(rows) // 2]
            beside: Any = {"ha": "center" if segment.closed else "right", "va": "bottom"}
            shift = (0, 8) if segment.closed else (-10, 4)
            text: Any = {"textcoords": "offset points", "fontsize": 9, "color": theme.ink}
            ax.annotate(names[index], tuple(positions[top, :2]), shift, **beside, **text)
    arrow = {"arrowstyle": "->", "linestyle": ":", "color": theme.ink, "linewidth": 1.1}
    for start, end in segments.links.tolist():
        ax.annotate(
            "", tuple(positions[end, :2]), tuple(positions[start, :2]), arrowprops=arrow, zorder=3
        )
    if place is not None:
        good = np.ones(len(place), np.bool_) if right is None else np.asarray(right, np.bool_)
        for mask, mark, colour, label in (
            (good, "o", theme.trusted_right, "right"),
            (~good, "X", theme.trusted_wrong, "wrong"),
        ):
            if mask.any():
                at = positions[np.asarray(place)[mask], :2]
                named = "a fix" if right is None else f"{label}: {mask.sum()}"
                size = 12 if mark == "o" else 45
                look: Any = {"marker": mark, "s": size, "color": colour, "linewidth": 0}
                ax.scatter(*at.T, label=named, zorder=4, alpha=0.8, **look)
        ax.legend(loc="lower left", bbox_to_anchor=(0, 1.01), ncols=2, borderaxespad=0)
    ax.set_aspect("equal")
    ax.margins(0.06)
    ax.set_xlabel("east (m)")
    ax.set_ylabel("north (m)")
    return ax
