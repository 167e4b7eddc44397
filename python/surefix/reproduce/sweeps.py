"""The area over one option: the weight from 0 to 1, and the length of the sequence from 2 to 9."""

from collections.abc import Mapping, Sequence

import numpy as np

from surefix import plot
from surefix.baselines import noisy_predictor
from surefix.baselines.distances import Flags, Floats
from surefix.report.page import Picture, Table
from surefix.reproduce.case import LENGTH, WEIGHT, Case, Settings
from surefix.reproduce.exhibit import Cell, Exhibit, listed, pictured, shown
from surefix.study import UPTO, Study

__all__ = ["ablation", "weight_sweep"]

LENGTHS = range(2, 10)
# Shares of the right and of the wrong single matches that are trusted.
GOOD = (0.8, 0.05)
POOR = (0.2, 0.6)

Band = tuple[Floats, Floats, Floats]
"""The area at each weight, and the low and the high end of its interval."""


def weight_sweep(cases: Sequence[Case], settings: Settings) -> Exhibit:
    """The weight from 0 to 1, with good and with poor predictors."""
    # With the paper's own weight among them.
    weights = np.union1d(np.linspace(0, 1, 5 if settings.quick else 21), [WEIGHT])
    rows: list[Sequence[Cell]] = []
    pictures: dict[str, Picture] = {}
    points = []
    for case in cases:
        bands = _bands(case.study(settings), weights, settings)
        for name, band in bands.items():
            numbers = zip(*(column.tolist() for column in (weights, *band)), strict=True)
            rows += [(case.dataset, case.technique, name, *point) for point in numbers]
        ends = ", ".join(
            f"{name} {area[0]:.2f} to {area[-1]:.2f}" for name, (area, *_) in bands.items()
        )
        alt = (
            f"Area up to recall {UPTO:g} by weight, for {case.name}; from weight 0 to weight 1: "
            f"{ends}."
        )
        pictures |= pictured("weight_sweep", case, alt, plot.weight_sweep, weights, bands)
        said = "; ".join(_said(name, weights, band[0]) for name, band in bands.items())
        points.append(
            f"{case.name}: {bands['perfect'][0][0]:.3f} unweighted. At weight {WEIGHT:g}: {said}."
        )
    return Exhibit(
        "How far to draw trusted matches: the weight from 0 to 1",
        (
            f"Sequences of L = {LENGTH}, the area up to recall {UPTO:g} at each weight; 0 is the "
            "unweighted sequence. Four predictors: the consensus; a perfect one, told the truth; a "
            f"good one that trusts {_rates(GOOD)}; and a poor one that trusts {_rates(POOR)}. The "
            f"latter two are drawn by chance {settings.draws} times each, and the mean is shown.",
            "Bands are 95 % block-bootstrap intervals of each curve by itself (the mean of their "
            "ends, for the drawn ones). They widen by the same luck of the drive, so two that "
            "overlap may still differ for sure: Table I has the interval of the difference.",
            "Break-even is the weight at which a line crosses the height that it has at weight 0.",
        ),
        pictures,
        points=points,
        name="weight_sweep",
        header="dataset,technique,predictor,weight,auc,low,high",
        rows=rows,
    )


def _bands(study: Study, weights: Floats, settings: Settings) -> Mapping[str, Band]:
    right = study.single_right
    predictors: dict[str, Sequence[Flags | None]] = {"consensus": [None], "perfect": [right]}
    for name, (share_right, share_wrong) in (("good", GOOD), ("poor", POOR)):
        predictors[name] = [
            noisy_predictor(
                right, true_positive_rate=share_right, false_positive_rate=share_wrong, seed=seed
            )
            for seed in range(settings.draws)
        ]
    return {name: _band(study, weights, flags, settings) for name, flags in predictors.items()}


def _band(study: Study, weights: Floats, flags: Sequence[Flags | None], settings: Settings) -> Band:
    """The mean over some predictions of the area and of its interval, at each weight."""
    means = []
    for weight in weights.tolist():
        curves = [study.at(weight=weight, trusted=each).shown.curve for each in flags]
        estimates = [
            (curve.auc(UPTO), *curve.auc_interval(UPTO, samples=settings.band_samples))
            for curve in curves
        ]
        means.append(np.mean(estimates, axis=0))
    auc, low, high = np.array(means).T
    return auc, low, high


def _said(name: str, weights: Floats, areas: Floats) -> str:
    """A predictor's sweep in words."""
    start, paper = areas[0], areas[np.flatnonzero(weights == WEIGHT)[0]]
    gains, costs = _spans(weights, areas > start), _spans(weights, areas < start)
    effect = "no weight costs" if gains else "no weight gains" if costs else "no weight changes it"
    if gains and costs:
        effect = f"gains at {gains}, costs at {costs}"
    return f"{name} {paper:.3f} ({effect})"


def _spans(weights: Floats, mask: Flags) -> str:
    """The weights that are set, as ranges."""
    turns = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])))).reshape(-1, 2)
    ends = [(weights[first], weights[last - 1]) for first, last in turns]
    return " and ".join(f"{low:g}" if low == high else f"{low:g} to {high:g}" for low, high in ends)


def _rates(rates: tuple[float, float]) -> str:
    right, wrong = (f"{100 * rate:.0f} %" for rate in rates)
    return f"{right} of the right matches and {wrong} of the wrong ones"


def ablation(cases: Sequence[Case], settings: Settings) -> Exhibit:
    """Every length of every case."""
    rows: list[Sequence[Cell]] = []
    pictures: dict[str, Picture] = {}
    lines, losses = [], []
    for case in cases:
        areas: dict[str, list[float]] = {"weighted": [], "unweighted": []}
        for length in LENGTHS:
            plain, weighted = case.study(settings).at(sequence_length=length).results
            before, after = plain.curve.auc(UPTO), weighted.curve.auc(UPTO)
            difference, low, high = weighted.difference
            areas["weighted"].append(after)
            areas["unweighted"].append(before)
            rows.append(
                (case.dataset, case.technique, length, before, after, difference, low, high)
            )
            if after < before:
                change = f"{before:.3f} to {after:.3f}, interval {low:+.3f} to {high:+.3f}"
                losses.append(f"{case.name}, L = {length} ({change})")
        lines += [(case.name, name, *map(shown, values)) for name, values in areas.items()]
        text = "; ".join(f"{name} {', '.join(map(shown, each))}" for name, each in areas.items())
        span = f"L from {LENGTHS[0]} to {LENGTHS[-1]}"
        alt = f"Area by sequence length for {case.name}, {span}: {text}."
        pictures |= pictured("ablation", case, alt, plot.ablation, LENGTHS, areas)
    total = len(cases) * len(LENGTHS)
    header = ("case", "sequence", *(f"L = {k}" for k in LENGTHS))
    said = f"In {len(losses)} of the {total} cases and lengths the weighted area is the smaller"
    return Exhibit(
        "The length of the sequence",
        (
            f"The area up to recall {UPTO:g} for L from {LENGTHS[0]} to {LENGTHS[-1]} queries, "
            f"unweighted and weighted with w = {WEIGHT:g}. A longer sequence waits longer for its "
            "first answer, and asks more of a robot to move as the first drive did.",
            f"{said}{': ' + listed(losses) if losses else ''}.",
        ),
        pictures,
        tables=(Table("ablation", f"Area up to recall {UPTO:g}", header, lines),),
        name="ablation",
        header="dataset,technique,length,unweighted,weighted,difference,low,high",
        rows=rows,
    )
