"""The axes of a figure: those that are given, or new ones."""

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec

import matplotlib
from matplotlib.axes import Axes

from surefix.errors import mismatch
from surefix.plot.theme import LIGHT

__all__ = ["end_at_tick", "on_axes"]

P = ParamSpec("P")


def on_axes(width: float, height: float) -> Callable[[Callable[P, Axes]], Callable[P, Axes]]:
    """For a function that draws on ``ax``: without it, makes a figure of ``matplotlib.pyplot`` of
    this size in inches, in the colours of ``theme``, so that notebooks and ``pyplot.show`` show it.
    """

    def decorated(draw: Callable[P, Axes]) -> Callable[P, Axes]:
        @wraps(draw)
        def drawn(*args: P.args, **kwargs: P.kwargs) -> Axes:
            options: dict[str, Any] = dict(kwargs)
            if (ax := options.get("ax")) is not None:
                if not isinstance(ax, Axes):
                    raise mismatch("ax", "matplotlib's Axes, or None", type(ax).__name__)
                return draw(*args, **kwargs)
            # It takes a while, and programs that draw files alone do without.
            from matplotlib import pyplot

            with matplotlib.rc_context(options.get("theme", LIGHT).settings):
                figure = pyplot.figure(figsize=(width, height), layout="constrained")
                try:
                    options["ax"] = figure.add_subplot()
                    return draw(*args, **options)
                except BaseException:
                    pyplot.close(figure)
                    raise

        return drawn

    return decorated


def end_at_tick(axis: Any, low: float, high: float) -> None:
    """Sets the limits of an axis of counted things (``ax.xaxis``), as of queries from 0 to 999. If
    a tick is just behind the end, as 1,000 is, the axis ends there: its length can be read.
    """
    ticks = axis.get_major_locator().tick_values(low, high)
    near = ticks[(ticks > high) & (ticks <= high + max(1.0, 0.01 * (high - low)))]
    axis.axes.set(**{f"{axis.axis_name}lim": (low, float(near[0]) if len(near) else high)})
