"""How sure an area under the curve is: a forest plot."""

from collections.abc import Mapping

from matplotlib.axes import Axes

from surefix.plot.theme import LIGHT, Theme

__all__ = ["Estimate", "auc_intervals"]

Estimate = tuple[float, float, float]
"""A value, and the low and the high end of its interval."""


def auc_intervals(
    ax: Axes,
    estimates: Mapping[str, Estimate],
    *,
    upto: float = 0.2,
    level: float = 0.95,
    baseline: str | None = None,
    theme: Theme = LIGHT,
) -> Axes:
    """Draws a row for each method: its area under the curve as a dot, the interval as a line.

    Parameters ---------- estimates : mapping of a name to (area, low, high) From the top down.
    upto, level : float The areas are up to this recall; the intervals hold this share of the
    bootstrap's samples. baseline : str, optional The name of the method that the others are
    compared to: a dashed line goes down from its dot.
    """
    for row, (name, (area, low, high)) in enumerate(estimates.items()):
        first = name == baseline
        colour = theme.muted if first else theme.trusted_right
        ax.plot(
            [low, high],
            [row, row],
            color=colour,
            linewidth=2.6,
            solid_capstyle="butt",
            zorder=3,
            clip_on=False,
        )
        ax.plot(
            area,
            row,
            linestyle="none",
            marker="s" if first else "o",
            markersize=8,
            color=colour,
            markeredgecolor=theme.paper,
            zorder=4,
            clip_on=False,
        )
        # To the right of all of them, as a column.
        ax.text(1.03, row, f"{area:.2f}  ({low:.2f} to {high:.2f})", va="center", clip_on=False)
        if first:
            ax.axvline(area, color=theme.muted, linewidth=1.0, linestyle=(0, (4, 3)), zorder=2)
    ax.set_yticks(range(len(estimates)), labels=list(estimates))
    ax.set_ylim(len(estimates) - 0.5, -0.5)
    ax.set_xlim(0, 1)
    ax.tick_params(axis="y", length=0, labelcolor=theme.ink)
    ax.set_xlabel(f"area under the curve up to recall {upto:g}, and its {100 * level:g} % interval")
    ax.grid(axis="x", linewidth=0.8)
    ax.set_axisbelow(True)
    return ax
