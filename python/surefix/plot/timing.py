"""How long it takes, against the size of the map."""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from surefix.plot.lines import looks
from surefix.plot.theme import LIGHT, Theme

__all__ = ["execution_time"]


def execution_time(
    ax: Axes,
    places: npt.ArrayLike,
    microseconds: Mapping[str, npt.ArrayLike],
    *,
    theme: Theme = LIGHT,
) -> Axes:
    """Draws the time a query takes against the number of places, both on logarithmic scales.

    Parameters
    ----------
    places : array of int, shape (k,)
        How many places the map has.
    microseconds : mapping of a name to an array of float, shape (k,)
        The mean time a query takes, more than 0; up to eight.
    """
    at = np.asarray(places, np.float64)
    for layer, ((name, times), look) in enumerate(
        zip(microseconds.items(), looks(theme, len(microseconds)), strict=True)
    ):
        style = look.line(len(at), layer) | {
            "marker": look.mark or "o",
            "markevery": None,
            "markersize": 4.5,
        }
        ax.plot(at, np.asarray(times, np.float64), label=name, **style)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlabel("places on the map")
    ax.set_ylabel("mean time for a query (microseconds)")
    ax.grid(linewidth=0.8)
    ax.set_axisbelow(True)
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1.0), alignment="left", handlelength=3.2)
    return ax
