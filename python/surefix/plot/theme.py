"""Colours and marks of the pictures, on light and on dark paper.

Hue says right (blue) or wrong (orange), strength says trusted or not, and the shape says both
again, so that nothing hangs on colour alone: right is round, wrong is a cross; trusted is bold,
untrusted is thin.
"""

import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from surefix import _colours
from surefix._colours import Colours
from surefix._saving import save
from surefix.errors import SurefixValueError
from surefix.plot.outcome import Outcome

__all__ = ["DARK", "LIGHT", "LOOKS", "MARKS", "Look", "Mark", "Theme", "looks", "png"]

DPI = 150

# Lines of one figure that can be told apart.
LOOKS = 8


@dataclass(frozen=True)
class Mark:
    """How a match is drawn in a matrix; ``size`` is in points squared, for a matrix of 5 inches."""

    shape: str
    size: float
    width: float
    hollow: bool = False


MARKS = {
    Outcome.TRUSTED_RIGHT: Mark("o", 9, 0.0),
    Outcome.TRUSTED_WRONG: Mark("X", 60, 0.8),
    Outcome.UNTRUSTED_RIGHT: Mark("o", 11, 0.7, hollow=True),
    Outcome.UNTRUSTED_WRONG: Mark("x", 9, 0.7),
}


@dataclass(frozen=True)
class Theme(Colours):
    """The colours of a picture, as every other view has them, and matplotlib's settings."""

    def colour(self, outcome: Outcome) -> str:
        """The colour of an outcome."""
        return str(getattr(self, outcome.name.lower()))

    @property
    def distance_map(self) -> LinearSegmentedColormap:
        """Distances as tones of the paper: far fades into it, near stands out."""
        return LinearSegmentedColormap.from_list("distance", [self.near, self.paper])

    @property
    def settings(self) -> Any:
        """What matplotlib has to be told, for ``matplotlib.rc_context``."""
        paper = ("figure.facecolor", "savefig.facecolor", "axes.facecolor")
        text = ("text.color", "axes.labelcolor", "axes.titlecolor")
        return {
            **dict.fromkeys(paper, self.paper),
            **dict.fromkeys(text, self.ink),
            **dict.fromkeys(("axes.edgecolor", "xtick.color", "ytick.color"), self.muted),
            "grid.color": self.grid,
            # A dollar in a name is a dollar, and begins no formula.
            "text.parse_math": False,
            "legend.frameon": False,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "font.size": 9.5,
            "axes.titlesize": 10.5,
            "axes.titleweight": "bold",
            "axes.titlelocation": "left",
        }


LIGHT, DARK = Theme(**vars(_colours.LIGHT)), Theme(**vars(_colours.DARK))


@dataclass(frozen=True)
class Look:
    """The look of one line."""

    colour: str
    dashes: Any
    width: float
    mark: str

    def line(self, points: int, layer: int) -> dict[str, Any]:
        """The options of ``Axes.plot`` for a line of these points, with a few marks on it."""
        # Each line's marks begin elsewhere, so that lines on top of each other show both.
        every = (0.02 + 0.017 * layer, 0.14) if points > 12 else None
        return {
            "color": self.colour,
            "linestyle": self.dashes,
            "linewidth": self.width,
            "marker": self.mark,
            "markersize": 5.5,
            "markevery": every,
            "zorder": 3 + (LOOKS - layer) / 10,
            "clip_on": False,
        }


def looks(theme: Theme, count: int) -> list[Look]:
    """The looks of ``count`` lines, the first the boldest; at most eight can be told apart."""
    if count > LOOKS:
        raise SurefixValueError(
            f"lines: expected at most {LOOKS} in one figure, got {count}; draw several figures"
        )
    styles: list[tuple[str, Any, float, str]] = [
        (theme.trusted_right, "-", 2.4, ""),
        (theme.trusted_wrong, (0, (5, 2)), 1.7, ""),
        (theme.ink, (0, (1, 1.5)), 1.7, ""),
        (theme.muted, "-.", 1.7, ""),
        (theme.truth, "-", 1.5, "o"),
        (theme.peak, (0, (5, 2)), 1.5, "s"),
        (theme.untrusted_right, (0, (1, 1.5)), 1.5, "^"),
        (theme.untrusted_wrong, "-.", 1.5, "D"),
    ]
    return [Look(*style) for style in styles[:count]]


def png(
    picture: Axes | Callable[[Axes, Theme], object],
    path: str | Path | None = None,
    *,
    size: tuple[float, float] | None = None,
    theme: Theme = LIGHT,
) -> bytes:
    r"""A picture at 150 dots an inch, as the bytes of a PNG file. It needs no display.

    Parameters
    ----------
    picture : Axes; or a function of an Axes and a Theme that draws on it
        As every function here returns them: their figure is drawn, and closed. A function draws on
        a new figure.
    path : str or path, optional
        A file to write, too.
    size : (width, height), optional
        In inches; by default that of the figure, or (6.4, 4.8).
    theme : Theme
        For a function.

    Raises
    ------
    SurefixFileError
        If the file cannot be written.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> run = surefix.match_distances(1 - np.eye(9, dtype=np.float32))
    >>> surefix.plot.png(run.plot(np.arange(9)), size=(4, 4))[:4]
    b'\x89PNG'
    """
    file = io.BytesIO()
    if isinstance(picture, Axes):
        from matplotlib import pyplot

        figure = picture.get_figure(root=True)
        assert figure is not None
        if size is not None:
            figure.set_size_inches(size)
        figure.savefig(file, format="png", dpi=DPI)
        pyplot.close(figure)
    else:
        with matplotlib.rc_context(theme.settings):
            figure = Figure(figsize=size or (6.4, 4.8), dpi=DPI, layout="constrained")
            figure.get_layout_engine().set(w_pad=0.1, h_pad=0.1)  # type: ignore[union-attr,call-arg]
            picture(figure.add_subplot(), theme)
            figure.savefig(file, format="png")
    if path is not None:
        save(Path(path), file.getvalue(), "cannot write the picture")
    return file.getvalue()
