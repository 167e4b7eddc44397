"""Small multiples: one picture of several panels with the same axes."""

import io
import math
from collections.abc import Callable, Sequence
from textwrap import fill
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from surefix.plot.theme import DPI, Theme
from surefix.report.page import Picture, few_colours

__all__ = ["multiples"]

# Inches of a page and of a phone's, whose letters are then as large as the page's.
PAGE, PHONE = 10.4, 3.9
# Pixels beside each other on a page of this width are about half of those of a phone's screen.
LETTERS = 9.0


def multiples(
    titles: Sequence[str],
    draw: Callable[[Axes, int, Theme], object],
    alt: str,
    *,
    x: str,
    y: str,
    names: Sequence[str] = (),
    columns: tuple[int, int] = (4, 2),
    height: float | Callable[[bool], float] = 1.9,
    caption: str = "",
) -> Picture:
    """A panel for each title, in rows, with one legend and the names of the axes once.

    Parameters
    ----------
    titles : sequence of str
    draw : function of an Axes, the index of its panel and a Theme
        All panels share both axes.
    alt : str
        For readers who cannot see it.
    x, y : str
        The names of the axes.
    names : sequence of str
        The names in the legend of the lines of the first panel, in order.
    columns : (int, int)
        On a page, and on a phone.
    height : float, or function of whether it is a phone
        Of a row, in inches.
    caption : str
    """

    def paint(theme: Theme, phone: bool) -> bytes:
        width, across = (PHONE, columns[1]) if phone else (PAGE, columns[0])
        across = min(across, len(titles))
        down = math.ceil(len(titles) / across)
        tall = height(phone) if callable(height) else height
        settings = theme.settings | {"font.size": LETTERS, "axes.titlesize": LETTERS}
        with matplotlib.rc_context(settings):
            size = width, down * tall + 0.75
            figure = Figure(figsize=size, dpi=DPI, layout="constrained")
            axes = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False)
            letters = int(15 * width / across)
            for index, ax in enumerate(axes.flat):
                if index >= len(titles):
                    ax.set_visible(False)
                    continue
                draw(ax, index, theme)
                _bare(ax, fill(titles[index], letters))
            # Below the last panel of a column, if its row is not full.
            for ax in axes.flat[len(titles) - across : len(titles)]:
                ax.xaxis.set_tick_params(labelbottom=True)
            if names:
                handles, _ = axes[0, 0].get_legend_handles_labels()
                how: Any = {"loc": "outside upper left", "ncols": 1 if phone else len(names)}
                figure.legend(handles, names, handlelength=2.6, **how)
            figure.supxlabel(fill(x, int(13 * width)), fontsize=LETTERS, color=theme.ink)
            figure.supylabel(y, fontsize=LETTERS, color=theme.ink)
            file = io.BytesIO()
            figure.savefig(file, format="png")
        return few_colours(file.getvalue())

    return Picture(
        lambda theme: paint(theme, False),
        alt,
        caption,
        wide=True,
        narrow=lambda theme: paint(theme, True),
    )


def _bare(ax: Axes, title: str) -> None:
    """The panel with its title, without the legend and the names of its axes."""
    if (legend := ax.get_legend()) is not None:
        legend.remove()
    ax.set_xlabel("")
    ax.set_ylabel("")
    ax.set_title(title, fontweight="normal")
