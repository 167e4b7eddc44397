"""Small multiples: one picture of several panels with the same axes, for a page and for a phone."""

import io
import math
from collections.abc import Callable, Mapping, Sequence
from textwrap import fill
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from surefix.plot.theme import DPI, Theme, looks
from surefix.report.page import Picture, few_colours

__all__ = ["forest", "multiples", "two_widths"]

# Inches of a page and of a phone's, whose letters are then as large as the page's.
PAGE, PHONE = 10.4, 3.9
LETTERS = 9.0

Interval = tuple[float | None, float | None, float | None]
"""A value, and the ends of its interval, if it has one; None for a value that there is not."""


def two_widths(
    draw: Callable[[Figure, Theme, bool], object],
    height: Callable[[bool], float],
    alt: str,
    caption: str = "",
) -> Picture:
    """A whole figure, drawn once for a page and once for a phone.

    Parameters
    ----------
    draw : function of a Figure, a Theme and whether it is a phone
    height : function of whether it is a phone
        Of the picture, in inches.
    alt, caption : str
    """

    def paint(theme: Theme, phone: bool) -> bytes:
        settings = theme.settings | {"font.size": LETTERS, "axes.titlesize": LETTERS}
        with matplotlib.rc_context(settings):
            size = PHONE if phone else PAGE, height(phone)
            figure = Figure(figsize=size, dpi=DPI, layout="constrained")
            figure.get_layout_engine().set(w_pad=0.06, h_pad=0.06)  # type: ignore[union-attr,call-arg]
            draw(figure, theme, phone)
            file = io.BytesIO()
            figure.savefig(file, format="png")
        return few_colours(file.getvalue())

    narrow: Callable[[Theme], bytes] = lambda theme: paint(theme, True)  # noqa: E731
    return Picture(lambda theme: paint(theme, False), alt, caption, wide=True, narrow=narrow)


def multiples(
    titles: Sequence[str],
    draw: Callable[[Axes, int, Theme], object],
    alt: str,
    *,
    x: str,
    y: str,
    columns: tuple[int, int] | None = None,
    heights: tuple[float, float] = (1.8, 1.6),
    caption: str = "",
) -> Picture:
    """A panel for each title, in rows, with one legend and the names of the axes once.

    Parameters
    ----------
    titles : sequence of str
    draw : function of an Axes, the index of its panel and a Theme
        All panels share both axes. Lines with one label in several panels are one in the legend; of
        a label with a colon the part before it.
    alt : str
        For readers who cannot see it.
    x, y : str
        The names of the axes.
    columns : (int, int), optional
        On a page, and on a phone; by default 4, or 5 of more than 8 panels, and 2.
    heights : (float, float)
        Of a row of panels, in inches.
    caption : str
    """
    widest = columns or (4 if len(titles) <= 8 else 5, 2)

    def rows(phone: bool) -> tuple[int, int]:
        across = min(widest[phone], len(titles))
        return math.ceil(len(titles) / across), across

    def paint(figure: Figure, theme: Theme, phone: bool) -> None:
        down, across = rows(phone)
        axes = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False)
        letters = int((PHONE if phone else PAGE) / across * 13)
        handles: dict[str, Any] = {}
        for index, ax in enumerate(axes.flat):
            if index >= len(titles):
                ax.set_visible(False)
                continue
            draw(ax, index, theme)
            for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
                handles.setdefault(label.partition(":")[0], handle)
            _bare(ax, fill(titles[index], letters))
            # Also above the empty end of the last row.
            ax.xaxis.set_tick_params(labelbottom=index >= len(titles) - across)
        _legend(figure, handles, 1 if phone else 4)
        figure.supxlabel(fill(x, int((PHONE if phone else PAGE) * 13)), fontsize=LETTERS)
        figure.supylabel(y, fontsize=LETTERS)

    def height(phone: bool) -> float:
        return rows(phone)[0] * heights[phone] + (1.3 if phone else 0.7)

    return two_widths(paint, height, alt, caption)


def forest(
    rows: Mapping[str, Mapping[str, Interval]],
    alt: str,
    *,
    x: str,
    limits: tuple[float, float | None] = (0, 1),
    none: str = "",
    caption: str = "",
) -> Picture:
    """A row for each name, on one axis: its values with their intervals, a colour each.

    Parameters
    ----------
    rows : mapping of a name to a mapping of a label to an interval
        The same two labels in each row.
    alt : str
    x : str
        The name of the axis.
    limits : (float, float or None)
        Of the axis.
    none : str
        The words in place of a value that there is not.
    caption : str
    """
    labels = list(next(iter(rows.values())))

    def paint(figure: Figure, theme: Theme, phone: bool) -> None:
        ax = figure.subplots()
        handles: dict[str, Any] = {}
        for row, (name, values) in enumerate(rows.items()):
            shown = [float(value) for value, _, _ in values.values() if value is not None]
            if len(shown) == 2 and all(low is None for _, low, _ in values.values()):
                ax.plot(shown, [row, row], color=theme.muted, linewidth=1.2, zorder=2)
            for place, (label, (value, low, high)) in enumerate(values.items()):
                # As of two curves, of which the first is the bolder.
                colour, mark = looks(theme, 2)[1 - place].colour, "so"[place]
                at = row + (0.0 if low is None else 0.16 * (2 * place - 1))
                if value is None:
                    here: Any = {"va": "center", "ha": "right", "color": colour}
                    height = row + 0.2 * (2 * place - 1)
                    ax.text(
                        0.99, height, f"{label}: {none}", transform=ax.get_yaxis_transform(), **here
                    )
                    continue
                if low is not None and high is not None:
                    line: Any = {"linewidth": 2.4, "solid_capstyle": "butt", "zorder": 3}
                    ax.plot([low, high], [at, at], color=colour, clip_on=False, **line)
                dot: Any = {"markersize": 7, "markeredgecolor": theme.paper, "zorder": 4}
                handles[label], *_ = ax.plot(value, at, mark, color=colour, clip_on=False, **dot)
            if phone:
                above: Any = {"va": "bottom", "transform": ax.get_yaxis_transform()}
                ax.text(0, row - 0.3, name, fontsize=LETTERS - 0.5, color=theme.ink, **above)
        ax.set_yticks(range(len(rows)), labels=[] if phone else list(rows))
        ax.set_ylim(len(rows) - 0.5, -0.8 if phone else -0.5)
        ax.tick_params(axis="y", length=0, labelcolor=theme.ink)
        ax.set_xlim(*limits)
        ax.set_xlabel(fill(x, int((PHONE if phone else PAGE) * 13)))
        ax.grid(axis="x", linewidth=0.8)
        ax.set_axisbelow(True)
        _legend(figure, {label: handles[label] for label in labels if label in handles}, 4)

    def height(phone: bool) -> float:
        return 1.0 + len(rows) * (0.5 if phone else 0.36)

    return two_widths(paint, height, alt, caption)


def _legend(figure: Figure, handles: Mapping[str, Any], columns: int) -> None:
    if handles:
        how: Any = {"loc": "outside upper left", "ncols": min(columns, len(handles))}
        figure.legend([*handles.values()], [*handles], handlelength=2.6, **how)


def _bare(ax: Axes, title: str) -> None:
    """The panel with its title, without the legend and the names of its axes, and with smaller
    marks, as it is small.
    """
    for line in ax.lines:
        if line.get_marker() != "*":
            line.set_markersize(0.6 * line.get_markersize())
    if (legend := ax.get_legend()) is not None:
        legend.remove()
    ax.set_xlabel("")
    ax.set_ylabel("")
    ax.set_title(title, fontweight="normal")
