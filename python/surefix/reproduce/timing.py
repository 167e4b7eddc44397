"""The time of a push against the number of places, with the two contributions apart."""

import gc
import time
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from surefix import plot
from surefix._core import Matcher
from surefix.baselines.distances import Floats
from surefix.plot.theme import Theme
from surefix.report.multiples import multiples
from surefix.report.page import Table
from surefix.reproduce.case import LENGTH, WEIGHT, Settings
from surefix.reproduce.exhibit import Exhibit, shown

__all__ = ["execution_time", "measure"]

COLUMNS = 8
WARM_UP = 20
# Pushes on the smallest and on the largest maps.
MOST, LEAST = 2000, 200


def measure(places: int, pushes: int) -> tuple[Floats, Floats]:
    """Microseconds of each push: prediction alone (L = 1, w = 0), and the whole. By turns."""
    rng = np.random.default_rng(places)
    columns = [rng.random(places, np.float32) for _ in range(COLUMNS)]
    matchers = (
        Matcher(places, sequence_length=1, weight=0.0),
        Matcher(places, sequence_length=LENGTH, weight=WEIGHT),
    )
    took = np.empty((2, WARM_UP + pushes))
    collecting = gc.isenabled()
    gc.disable()
    try:
        for push in range(WARM_UP + pushes):
            column = columns[push % COLUMNS]
            # Each goes first half of the time: the second finds the column in the cache.
            for which in (0, 1) if push % 2 else (1, 0):
                start = time.perf_counter_ns()
                matchers[which].push(column)
                took[which, push] = time.perf_counter_ns() - start
    finally:
        if collecting:
            gc.enable()
    prediction, whole = took[:, WARM_UP:] / 1000
    return prediction, whole


def execution_time(machine: str, settings: Settings) -> Exhibit:
    """The times on this machine."""
    sizes = (
        (100, 1000, 10_000) if settings.quick else (100, 300, 1000, 3000, 10_000, 30_000, 100_000)
    )
    rows: list[tuple[float, ...]] = []
    # The processor has to wake up first, or the smallest map looks slow.
    measure(sizes[-1], LEAST)
    for places in sizes:
        pushes = 50 if settings.quick else max(LEAST, min(MOST, 2_000_000 // places))
        prediction, whole = measure(places, pushes)
        medians = float(np.median(prediction)), float(np.median(whole))
        means = float(prediction.mean()), float(whole.mean())
        rows.append(
            (places, pushes, *medians, medians[1] - medians[0], *means, means[1] - means[0])
        )
    said = _said(rows)
    alt = f"Time by number of places. {said}"
    picture = multiples(
        [""],
        lambda ax, _, theme: _draw(rows, ax=ax, theme=theme),
        alt,
        x="places on the map",
        y="median time for a push (microseconds)",
        heights=(3.6, 3.0),
    )
    header = (
        "places", "mean: prediction", "mean: weighted sequence", "mean: whole",
        "median: prediction", "median: weighted sequence", "median: whole",
    )  # fmt: skip
    lines = [(f"{int(row[0]):,}", *(shown(row[k], 2) for k in (5, 7, 6, 2, 4, 3))) for row in rows]
    return Exhibit(
        "Execution time",
        (
            "The time of Matcher.push from Python, the distances being there already: getting "
            "them, from images or descriptors, is not in it. Random distances, on one thread of "
            f"this machine: {machine}. At least {int(min(row[1] for row in rows))} pushes of each, "
            "by turns. The picture shows medians, which a push that the system interrupted does "
            "not move; the table, means too.",
            "Prediction: a matcher with L = 1 and w = 0, which still finds the nearest place, the "
            f"gradient and the consensus. Whole: L = {LENGTH} and w = {WEIGHT:g}. Weighted "
            "sequence: the difference of the two; if that is lost in the noise, or in the cost of "
            "a call from Python, it has no point in the picture.",
            said,
        ),
        {"execution_time.png": picture},
        tables=(Table("execution-time", "Microseconds for a push", header, lines, sorts=True),),
        name="execution_time",
        header="places,pushes,prediction_median_us,whole_median_us,sequence_us,prediction_mean_us,"
        "whole_mean_us,sequence_mean_us",
        rows=rows,
    )


def _said(rows: Sequence[Sequence[float]]) -> str:
    first, last = rows[0], rows[-1]
    return (
        f"With {int(last[0]):,} places the whole takes {last[6]:.0f} microseconds in the mean, "
        f"{last[5]:.0f} of them for the prediction. In the median it is {last[3]:.0f} and "
        f"{last[2]:.0f}, and {1000 * (last[3] - first[3]) / (last[0] - first[0]):.2f} nanoseconds "
        "for each place more."
    )


def _draw(rows: Sequence[Sequence[float]], *, ax: Axes, theme: Theme) -> Axes:
    table = np.array(rows)
    sequence = np.where(table[:, 4] > 0, table[:, 4], np.nan)
    times = {
        "whole": table[:, 3],
        "prediction (gradient and consensus)": table[:, 2],
        "weighted sequence (the difference)": sequence,
    }
    return plot.execution_time(table[:, 0], times, ax=ax, theme=theme)
