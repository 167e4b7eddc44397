"""Ratios as a picture: how many times faster, against what is to be reached."""

from collections.abc import Sequence
from math import isfinite
from typing import TYPE_CHECKING

from surefix.bench.line import Result, Row
from surefix.bench.table import factor
from surefix.plot.theme import LIGHT, Theme
from surefix.report.page import Picture, drawn

if TYPE_CHECKING:
    # Not before surefix.plot, which says what to install where there is no matplotlib.
    from matplotlib.axes import Axes

__all__ = ["draw", "picture"]


def picture(results: Sequence[Result]) -> Picture:
    """All rivals in one picture, on light and on dark paper."""
    rows = _shown(results)
    size = 10.5, 1.1 + 0.3 * (len(rows) + 0.55 * len({row.line.work for row in rows}))

    met, asked = sum(row.met is True for row in rows), sum(row.met is not None for row in rows)
    alt = f"How many times faster surefix is than each of {len(rows)} rivals; {met} of {asked} marks are reached."
    return drawn(lambda ax, theme: draw(ax, results, theme), size, alt, small=True)


def _shown(results: Sequence[Result]) -> list[Row]:
    return [
        row for result in results for row in result.rows if isfinite(row.ratio) and row.ratio > 0
    ]


def draw(ax: "Axes", results: Sequence[Result], theme: Theme = LIGHT) -> "Axes":
    """Draws a line from level to each ratio, on a logarithmic scale, under the name of the work.

    A round blue end is as fast as it is to be, an orange cross is not, and a grey one is held to
    nothing. The upright tick is what is to be reached.
    """
    rows = _shown(results)
    y, seen, labels = 0.0, "", []
    for row in rows:
        if row.line.work != seen:
            seen = row.line.work
            y += 0.55
            ax.text(-0.005, y, seen, transform=ax.get_yaxis_transform(), ha="right", va="center", weight="bold",
                    color=theme.ink, fontsize=8.8)  # fmt: skip
            y += 0.8
        _draw_row(ax, row, y, theme)
        labels.append((y, row.rival.name))
        y += 1
    for at, name in labels:
        ax.text(-0.005, at, name, transform=ax.get_yaxis_transform(), ha="right", va="center", color=theme.muted,
                fontsize=8.8)  # fmt: skip
    reaches = [row.rival.reach.least for row in rows if row.rival.reach]
    ratios = [row.ratio for row in rows] + reaches + [1.0]
    ax.set_xscale("log")
    ax.set_xlim(min(ratios) / 1.35, max(ratios) * 1.9)
    ax.set_ylim(y - 0.4, 0)
    ax.axvline(1, color=theme.muted, linewidth=1.0, zorder=1)
    ticks = [
        tick
        for tick in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500)
        if min(ratios) / 1.35 <= tick
    ]
    ax.set_xticks([tick for tick in ticks if tick <= max(ratios) * 1.9])
    ax.set_xticklabels([f"{tick:g} x" for tick in ax.get_xticks()])
    ax.minorticks_off()
    ax.set_yticks([])
    ax.spines["left"].set_visible(False)
    ax.grid(axis="x", linewidth=0.7)
    ax.set_axisbelow(True)
    ax.set_xlabel(
        "its time / surefix's time: right of 1 x surefix is faster\n"
        "the upright tick is to be reached: a blue dot does,\n"
        "an orange cross does not; grey is held to nothing"
    )
    return ax


def _draw_row(ax: "Axes", row: Row, y: float, theme: Theme) -> None:
    good = row.met is not False and not row.problem
    colour = (
        theme.muted if row.met is None else theme.trusted_right if good else theme.trusted_wrong
    )
    ax.plot(
        [1, row.ratio],
        [y, y],
        color=colour,
        linewidth=2.2,
        solid_capstyle="butt",
        alpha=0.75,
        zorder=2,
    )
    ax.plot(
        row.ratio,
        y,
        marker="o" if good else "X",
        color=colour,
        markersize=6.5,
        markeredgewidth=0,
        zorder=4,
    )
    furthest = row.ratio
    if row.rival.reach:
        least = row.rival.reach.least
        ax.plot([least, least], [y - 0.36, y + 0.36], color=theme.ink, linewidth=1.6, zorder=3)
        furthest = max(furthest, least)
    said = "answers differ" if row.problem else factor(row.ratio)
    ax.annotate(said, (max(furthest, 1.0), y), xytext=(7, 0), textcoords="offset points", va="center", color=theme.ink,
                fontsize=8.8, zorder=5)  # fmt: skip
