"""The area over one option: the weight from 0 to 1, and the length of the sequence from 2 to 9."""

from collections.abc import Sequence

import numpy as np

from surefix import plot
from surefix._ray import mapped
from surefix.baselines import noisy_predictor
from surefix.baselines.distances import Flags, Floats
from surefix.report.page import Table
from surefix.reproduce.case import LENGTH, WEIGHT, Case, Settings
from surefix.reproduce.exhibit import Cell, Exhibit, listed, pictured, shown
from surefix.study import UPTO, Estimate

__all__ = ["ablation", "weight_sweep"]

LENGTHS = range(2, 10)
# Shares of the right and of the wrong single matches that are trusted.
GOOD = (0.8, 0.05)
POOR = (0.2, 0.6)
DRAWN = {"good": GOOD, "poor": POOR}
PREDICTORS = ("consensus", "perfect", *DRAWN)

Band = tuple[Floats, Floats, Floats]
"""The area at each weight, and the low and the high end of its interval."""


def weight_sweep(cases: Sequence[Case], settings: Settings) -> Exhibit:
    """The weight from 0 to 1, with good and with poor predictors."""
    # With the paper's own weight among them.
    weights = np.union1d(np.linspace(0, 1, 5 if settings.quick else 21), [WEIGHT])
    rows: list[Sequence[Cell]] = []
    lines = []
    jobs = [(at, name, weights, settings) for at in range(len(cases)) for name in PREDICTORS]
    swept: dict[Case, dict[str, Band]] = {case: {} for case in cases}
    for (at, name, *_), found in zip(jobs, mapped(_band, cases, jobs), strict=True):
        swept[cases[at]][name] = found
    at = int(np.flatnonzero(weights == WEIGHT)[0])
    for case, bands in swept.items():
        for name, band in bands.items():
            numbers = zip(*(column.tolist() for column in (weights, *band)), strict=True)
            rows += [(case.dataset, case.technique, name, *point) for point in numbers]
        area = bands["consensus"][0]
        spans = (_spans(weights, which) for which in (area > area[0], area < area[0]))
        start = shown(bands["perfect"][0][0])
        areas = (shown(band[0][at]) for band in bands.values())
        lines.append((case.name, start, *areas, *(span or "\u2013" for span in spans)))
    pictures = pictured(
        "weight_sweep",
        cases,
        lambda ax, case, theme: plot.weight_sweep(weights, swept[case], ax=ax, theme=theme),
        lambda case: (
            "area from weight 0 to weight 1: "
            + ", ".join(
                f"{name} {area[0]:.2f} to {area[-1]:.2f}"
                for name, (area, *_) in swept[case].items()
            )
        ),
        x="weight w (0: unweighted, 1: a trusted match is drawn down to the floor)",
        y=f"area up to recall {UPTO:g}",
    )
    header = ("case", "unweighted", *next(iter(swept.values())), "gains at", "costs at")
    caption = f"Area at weight {WEIGHT:g}, and the weights at which the consensus gains and costs"
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
        tables=(Table("weight-sweep", caption, header, lines, sorts=True),),
        name="weight_sweep",
        header="dataset,technique,predictor,weight,auc,low,high",
        rows=rows,
    )


def _band(cases: Sequence[Case], job: tuple[int, str, Floats, Settings]) -> Band:
    """The mean over some predictions of the area and of its interval, at each weight."""
    at, name, weights, settings = job
    study = cases[at].study(settings)
    right = study.single_right
    flags: list[Flags | None] = [right if name == "perfect" else None]
    if name in DRAWN:
        share_right, share_wrong = DRAWN[name]
        flags = [
            noisy_predictor(
                right, true_positive_rate=share_right, false_positive_rate=share_wrong, seed=seed
            )
            for seed in range(settings.draws)
        ]
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


def _spans(weights: Floats, mask: Flags) -> str:
    """The weights that are set, as ranges."""
    turns = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])))).reshape(-1, 2)
    ends = [(weights[first], weights[last - 1]) for first, last in turns]
    return " and ".join(f"{low:g}" if low == high else f"{low:g} to {high:g}" for low, high in ends)


def _rates(rates: tuple[float, float]) -> str:
    right, wrong = (f"{100 * rate:.0f} %" for rate in rates)
    return f"{right} of the right matches and {wrong} of the wrong ones"


def _at_length(
    cases: Sequence[Case], job: tuple[int, int, Settings]
) -> tuple[float, float, Estimate, str]:
    """The two areas, their difference, and whether weighting wins."""
    at, length, settings = job
    plain, weighted = cases[at].study(settings).at(sequence_length=length).results
    areas = plain.curve.auc(UPTO), weighted.curve.auc(UPTO)
    return *areas, weighted.difference, weighted.outcome


def ablation(cases: Sequence[Case], settings: Settings) -> Exhibit:
    """Every length of every case."""
    rows: list[Sequence[Cell]] = []
    lines: list[Sequence[str]] = []
    areas: dict[Case, dict[str, list[float]]] = {}
    apart: dict[str, list[str]] = {"larger": [], "smaller": [], "wins": [], "loses": []}
    jobs = [(at, length, settings) for at in range(len(cases)) for length in LENGTHS]
    measured = mapped(_at_length, cases, jobs)
    for case in cases:
        own = areas[case] = {"weighted": [], "unweighted": []}
        for length in LENGTHS:
            before, after, difference, outcome = next(measured)
            own["weighted"].append(after)
            own["unweighted"].append(before)
            rows.append((case.dataset, case.technique, length, before, after, *difference))
            said = f"{case.name}, L = {length} ({after - before:+.3f})"
            if after != before:
                apart["larger" if after > before else "smaller"].append(said)
            if outcome != "level":
                apart[outcome].append(said)
        lines += [(case.name, name, *map(shown, values)) for name, values in own.items()]
    pictures = pictured(
        "ablation",
        cases,
        lambda ax, case, theme: plot.ablation(LENGTHS, areas[case], ax=ax, theme=theme),
        lambda case: "; ".join(
            f"{name} {', '.join(map(shown, each))}" for name, each in areas[case].items()
        ),
        x="sequence length L (queries)",
        y=f"area up to recall {UPTO:g}",
    )
    total = len(cases) * len(LENGTHS)
    header = ("case", "sequence", *(f"L = {k}" for k in LENGTHS))
    wins, loses = apart["wins"], apart["loses"]
    points = [
        f"Of the {total} cases and lengths the weighted area is larger in {len(apart['larger'])} "
        f"and smaller in {len(apart['smaller'])}. Its interval is above 0 in {len(wins)}, below 0 "
        f"in {len(loses)}{': ' + listed(loses) if loses else ''}."
    ]
    return Exhibit(
        "The length of the sequence",
        (
            f"The area up to recall {UPTO:g} for L from {LENGTHS[0]} to {LENGTHS[-1]} queries, "
            f"unweighted and weighted with w = {WEIGHT:g}. A longer sequence waits longer for its "
            "first answer, and asks more of a robot to move as the first drive did.",
        ),
        pictures,
        tables=(Table("ablation", f"Area up to recall {UPTO:g}", header, lines, sorts=True),),
        points=points,
        name="ablation",
        header="dataset,technique,length,unweighted,weighted,difference,low,high",
        rows=rows,
    )
