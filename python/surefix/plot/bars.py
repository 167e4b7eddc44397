"""Bars, dots and cells: counts and areas by method, right and wrong along the route."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from surefix import Trust
from surefix.plot.axes import end_at_tick, on_axes
from surefix.plot.theme import LIGHT, Theme

__all__ = [
    "Band",
    "Estimate",
    "auc_intervals",
    "estimates",
    "false_positives",
    "route_strip",
    "trust_table",
]

PITCH = 1.16

Band = tuple[str, NDArray[np.bool_], NDArray[np.bool_]]
"""A name; which queries' matches are right; and which queries are shown at all. Both of shape
(m,)."""

Estimate = tuple[float, float, float]
"""A value, and the low and the high end of its interval."""


@on_axes(6.4, 3)
def false_positives(
    counts: Mapping[str, int | None],
    *,
    recall: float = 0.2,
    ax: Axes | None = None,
    theme: Theme = LIGHT,
) -> Axes:
    """Draws a bar for each method: the wrong matches accepted by the time that ``recall`` is
    reached.

    Parameters
    ----------
    counts : mapping of a name to a count
        As of ``Evaluation.false_positives_at``; None if the recall is never reached, which is
        said in place of the bar.
    recall : float
        The recall at which they were counted.
    ax : Axes, optional
        Where to draw; by default a new figure.
    """
    assert ax is not None
    longest = max((count for count in counts.values() if count is not None), default=0)
    for row, (name, count) in enumerate(counts.items()):
        if count is None:
            text = f"never reaches recall {recall:g}"
            ax.text(0.01 * max(longest, 1), row, text, va="center", color=theme.muted)
            continue
        ax.barh(row, count, height=0.62, color=theme.trusted_wrong, label=name)
        ax.text(count + 0.01 * max(longest, 1), row, str(count), va="center")
    ax.set_xlim(0, 1.12 * max(longest, 1))
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlabel(f"false positives at recall {recall:g} (wrong matches accepted)")
    return _rows(ax, list(counts), theme)


@on_axes(6.4, 3)
def auc_intervals(
    estimates: Mapping[str, Estimate],
    *,
    upto: float = 0.2,
    level: float = 0.95,
    baseline: str | None = None,
    ax: Axes | None = None,
    theme: Theme = LIGHT,
) -> Axes:
    """Draws a row for each method: its area under the curve as a dot, the interval as a line.

    Parameters
    ----------
    estimates : mapping of a name to (area, low, high)
        From the top down.
    upto, level : float
        The areas are up to this recall; the intervals hold this share of the bootstrap's samples.
    baseline : str, optional
        The name of the method that the others are compared to: a dashed line goes down from its
        dot.
    ax : Axes, optional
        Where to draw; by default a new figure.
    """
    assert ax is not None
    _estimates(ax, estimates, baseline, theme)
    ax.set_xlabel(f"area under the curve up to recall {upto:g}, and its {100 * level:g} % interval")
    return ax


@on_axes(6.4, 2.4)
def estimates(
    values: Mapping[str, Estimate],
    *,
    label: str = "share, and its 95 % interval",
    baseline: str | None = None,
    ax: Axes | None = None,
    theme: Theme = LIGHT,
) -> Axes:
    """Draws a row for each share that was estimated, as a dot, its interval as a line.

    Parameters
    ----------
    values : mapping of a name to (value, low, high)
        From the top down; a NaN is said in place of the dot.
    label : str
        The name of the axis.
    baseline : str, optional
        The name of the row that the others are compared to: a dashed line goes down from its dot.
    ax : Axes, optional
        Where to draw; by default a new figure.
    """
    assert ax is not None
    _estimates(ax, values, baseline, theme)
    ax.set_xlabel(label)
    return ax


def _estimates(
    ax: Axes, values: Mapping[str, Estimate], baseline: str | None, theme: Theme
) -> None:
    for row, (name, (area, low, high)) in enumerate(values.items()):
        if np.isnan(area):
            ax.text(0.01, row, "none to judge", va="center", color=theme.muted)
            continue
        first = name == baseline
        colour, mark = (theme.muted, "s") if first else (theme.trusted_right, "o")
        line: Any = {"linewidth": 2.6, "solid_capstyle": "butt", "zorder": 3}
        ax.plot([low, high], [row, row], color=colour, clip_on=False, **line)
        dot: Any = {"markersize": 8, "markeredgecolor": theme.paper, "zorder": 4}
        ax.plot(area, row, mark, color=colour, clip_on=False, **dot)
        # To the right of all of them, as a column.
        ax.text(1.03, row, f"{area:.2f}  ({low:.2f} to {high:.2f})", va="center", clip_on=False)
        if first:
            ax.axvline(area, color=theme.muted, linewidth=1.0, linestyle=(0, (4, 3)), zorder=2)
    ax.set_xlim(0, 1)
    _rows(ax, list(values), theme)


def _rows(ax: Axes, names: list[str], theme: Theme) -> Axes:
    """A row for each name, from the top down."""
    ax.set_yticks(range(len(names)), labels=names)
    ax.set_ylim(len(names) - 0.5, -0.5)
    ax.tick_params(axis="y", length=0, labelcolor=theme.ink)
    ax.grid(axis="x", linewidth=0.8)
    ax.set_axisbelow(True)
    return ax


@on_axes(6.4, 3)
def trust_table(trust: Trust, *, ax: Axes | None = None, theme: Theme = LIGHT) -> Axes:
    """Draws four cells, trusted or not by right or wrong: the number of single matches, and their
    share.

    Parameters
    ----------
    trust : Trust
        As of ``surefix.evaluate_trust``. The depth of a cell is its share.
    ax : Axes, optional
        Where to draw; by default a new figure.
    """
    assert ax is not None
    t = trust
    counts = t.true_positives, t.false_positives, t.false_negatives, t.true_negatives
    total = max(1, sum(counts))
    for cell, count in enumerate(counts):
        row, column = divmod(cell, 2)
        colour = theme.trusted_wrong if column else theme.trusted_right
        box, depth = ((column, row), 1, 1), 0.06 + 0.34 * count / total
        ax.add_patch(Rectangle(*box, facecolor=colour, alpha=depth, linewidth=0))
        ax.add_patch(Rectangle(*box, fill=False, edgecolor=theme.grid, linewidth=1.2))
        middle: Any = {"ha": "center", "va": "center"}
        at = column + 0.5
        ax.text(at, row + 0.44, str(count), fontsize=17, fontweight="bold", **middle)
        share = f"{100 * count / total:.1f} %"
        ax.text(at, row + 0.74, share, color=theme.ink, fontsize=9.5, **middle)
    ax.set_xlim(0, 2)
    ax.set_ylim(2, 0)
    ax.set_xticks([0.5, 1.5], labels=["right", "wrong"])
    ax.set_yticks([0.5, 1.5], labels=["trusted", "not trusted"])
    ax.xaxis.tick_top()
    ax.tick_params(length=0, labelcolor=theme.ink, labelsize=10.5)
    ax.set_xlabel(
        f"precision {trust.precision:.3f},  recall {trust.recall:.3f},\n"
        f"{100 * trust.share_trusted:.1f} % of the single matches are trusted"
    )
    for spine in ax.spines.values():
        spine.set_visible(False)
    return ax


@on_axes(9, 2.6)
def route_strip(
    positions: NDArray[np.float64],
    bands: Sequence[Band],
    *,
    gap: tuple[float, float] | None = None,
    along: str = "position along the route (m)",
    unit: str = "m",
    ax: Axes | None = None,
    theme: Theme = LIGHT,
) -> Axes:
    """Draws a band for each way of matching: right upwards, wrong downwards, nothing for a query
    that is not shown.

    Parameters
    ----------
    positions : array of float, shape (m,)
        The way along the route at which each query was taken, ascending.
    bands : sequence of (name, right, shown)
        From the top down.
    gap : (from, to), optional
        A stretch to bracket under the last band: the longest without a right fix in it.
    along, unit : str
        The name of the axis, and the unit of the stretch.
    ax : Axes, optional
        Where to draw; by default a new figure.
    """
    assert ax is not None
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
            bars = spans(edges, mask), (middle, height)
            ax.broken_barh(*bars, facecolors=colour, linewidth=0)
        ax.axhline(middle, color=theme.muted, linewidth=0.7)
        wrong = int((~right & shown).sum())
        text = f"{name}: {int((right & shown).sum())} right, {wrong} wrong"
        ax.text(first, middle + 0.42, text, va="bottom", fontsize=9.5, color=theme.ink)
    bottom = -(len(bands) - 1) * PITCH - 0.5
    if gap is not None:
        start, stop = gap
        level = bottom - 0.05
        style = {"arrowstyle": "|-|,widthA=0.25,widthB=0.25", "shrinkA": 0, "shrinkB": 0}
        ax.annotate("", (start, level), (stop, level), arrowprops=style | {"color": theme.ink})
        at, side = (start, "left") if start + stop < first + last else (stop, "right")
        text = f"longest stretch without a right one: {stop - start:.0f} {unit}"
        ax.text(at, level - 0.1, text, ha=side, va="top", fontsize=8.5, color=theme.ink)
        bottom -= 0.45
    end_at_tick(ax.xaxis, first, last)
    ax.set_ylim(bottom, 0.66)
    ax.set_yticks([])
    ax.spines["left"].set_visible(False)
    ax.set_xlabel(f"{along};  up: right,  down: wrong,  empty: none accepted")
    return ax


def spans(edges: NDArray[np.float64], mask: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Start and length of each run of set queries: in one piece no seam looks like a gap."""
    turns = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False]))))
    return [(float(edges[a]), float(edges[b] - edges[a])) for a, b in turns.reshape(-1, 2)]
