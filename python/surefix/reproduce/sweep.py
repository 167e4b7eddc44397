"""The weight from 0 to 1, with good and with poor predictors."""

from collections.abc import Mapping, Sequence

import numpy as np

from surefix import plot
from surefix._core import Evaluation
from surefix.baselines import noisy_predictor
from surefix.baselines.distances import Flags, Floats
from surefix.report.page import Picture
from surefix.reproduce.case import UPTO, WEIGHT, Case, Settings
from surefix.reproduce.comparison import Cell, Comparison, drawn, stem

__all__ = ["GOOD", "POOR", "Band", "compare", "weights"]

LENGTH = 2
# Shares of the right and of the wrong single matches that are trusted.
GOOD = (0.8, 0.05)
POOR = (0.2, 0.6)

Band = tuple[Floats, Floats, Floats]
"""The area at each weight, and the low and the high end of its interval."""


def weights(settings: Settings) -> Floats:
    """From 0 to 1, with the paper's own among them."""
    steps = np.linspace(0, 1, 5 if settings.quick else 21)
    return np.union1d(steps, [WEIGHT])


def compare(cases: Sequence[Case], settings: Settings) -> Comparison:
    """The sweep of each case."""
    grid = weights(settings)
    rows: list[Sequence[Cell]] = []
    pictures, points = {}, []
    for case in cases:
        bands = _bands(case, grid, settings)
        for name, band in bands.items():
            numbers = zip(*(column.tolist() for column in (grid, *band)), strict=True)
            rows += [(case.dataset, case.technique, name, *point) for point in numbers]
        pictures[stem("weight_sweep", case.dataset, case.technique)] = _picture(case, grid, bands)
        said = "; ".join(_said(name, grid, band) for name, band in bands.items())
        points.append(
            f"{case.name}: {bands['perfect'][0][0]:.3f} unweighted. At weight {WEIGHT:g}: {said}."
        )
    return Comparison(
        "weight_sweep",
        "How far to draw trusted matches: the weight from 0 to 1",
        (
            f"Sequences of L = {LENGTH}, the area up to recall {UPTO:g} at each weight; 0 is the unweighted sequence. "
            f"Four predictors: the consensus; a perfect one, told the truth; a good one that trusts {_rates(GOOD)}; "
            f"and a poor one that trusts {_rates(POOR)}. The latter two are drawn by chance {settings.draws} "
            "times each, and the mean is shown.",
            "Bands are 95 % block-bootstrap intervals of each curve by itself (the mean of their ends, for the drawn "
            "ones). They widen by the same luck of the drive, so two that overlap may still differ for sure: Table I "
            "has the interval of the difference.",
            "Break-even is where a line crosses the height that it has at weight 0.",
        ),
        ("dataset", "technique", "predictor", "weight", "auc", "low", "high"),
        rows,
        pictures,
        points=points,
    )


def _bands(case: Case, grid: Floats, settings: Settings) -> Mapping[str, Band]:
    right = case.right()
    drawn_flags = {
        name: [
            noisy_predictor(
                right, true_positive_rate=rates[0], false_positive_rate=rates[1], seed=seed
            )
            for seed in range(settings.draws)
        ]
        for name, rates in (("good", GOOD), ("poor", POOR))
    }
    predictors: dict[str, Sequence[Flags | None]] = {
        "consensus": [None],
        "perfect": [right],
        **drawn_flags,
    }
    return {name: _band(case, grid, flags, settings) for name, flags in predictors.items()}


def _band(case: Case, grid: Floats, flags: Sequence[Flags | None], settings: Settings) -> Band:
    """The mean over some predictions of the area and of its interval, at each weight."""
    means = []
    for weight in grid.tolist():
        drawn_curves = [
            case.evaluate(case.weighted(LENGTH, weight=weight, trusted=trusted), settings)
            for trusted in flags
        ]
        means.append(np.mean([_estimate(curve, settings) for curve in drawn_curves], axis=0))
    auc, low, high = np.array(means).T
    return auc, low, high


def _estimate(curve: Evaluation, settings: Settings) -> tuple[float, float, float]:
    return (curve.auc(UPTO), *curve.auc_interval(UPTO, samples=settings.band_samples))


def _said(name: str, grid: Floats, band: Band) -> str:
    """What the sweep says of a predictor."""
    areas = band[0]
    start, paper = areas[0], areas[np.flatnonzero(grid == WEIGHT)[0]]
    better, worse = areas > start, areas < start
    if not better.any() and not worse.any():
        where = "no weight changes it"
    elif not worse.any():
        where = "no weight costs"
    elif not better.any():
        where = "no weight gains"
    else:
        where = f"gains at {_spans(grid, better)}, costs at {_spans(grid, worse)}"
    return f"{name} {paper:.3f} ({where})"


def _spans(grid: Floats, mask: Flags) -> str:
    """The weights that are set, as ranges."""
    turns = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])))).reshape(-1, 2)
    ends = [(grid[first], grid[last - 1]) for first, last in turns]
    return " and ".join(f"{low:g}" if low == high else f"{low:g} to {high:g}" for low, high in ends)


def _rates(rates: tuple[float, float]) -> str:
    return f"{rates[0]:.0%} of the right matches and {rates[1]:.0%} of the wrong ones".replace(
        "%", " %"
    )


def _picture(case: Case, grid: Floats, bands: Mapping[str, Band]) -> Picture:
    ends = ", ".join(
        f"{name} {band[0][0]:.2f} to {band[0][-1]:.2f}" for name, band in bands.items()
    )
    return drawn(
        lambda ax, theme: plot.weight_sweep(ax, grid, bands, theme=theme),
        f"Area up to recall {UPTO:g} by weight, for {case.name}; from weight 0 to weight 1: {ends}.",
        case.name,
    )
