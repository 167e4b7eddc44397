"""The break-even: the share of wrong matches that a predictor may trust before weighting costs."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from surefix._core import Trust
from surefix._ray import mapped
from surefix.baselines import noisy_predictor
from surefix.baselines.distances import Floats
from surefix.plot.curves import finish, star
from surefix.plot.theme import Theme
from surefix.report.page import Table
from surefix.reproduce.case import LENGTH, WEIGHT, Case, Settings
from surefix.reproduce.exhibit import Cell, Exhibit, listed, pictured, shown
from surefix.study import UPTO

__all__ = ["BreakEven", "break_even", "crossing", "measure"]


@dataclass(frozen=True, eq=False)
class BreakEven:
    """The area at each false positive rate, the true positive rate being the consensus's own.

    Attributes
    ----------
    case : Case
    trust : Trust
        That of the consensus.
    rates, areas : array of float
    lowest, highest : array of float
        The worst and the best of the drawn predictors at each rate.
    baseline, consensus : float
        The areas of the unweighted sequence, and of the one weighted by the consensus.
    """

    case: Case
    trust: Trust
    rates: Floats
    areas: Floats
    lowest: Floats
    highest: Floats
    baseline: float
    consensus: float

    @property
    def rate(self) -> float | None:
        """The false positive rate of the break-even; None if weighting never costs."""
        return crossing(self.rates, self.areas, self.baseline)

    @property
    def precision(self) -> float | None:
        """The share of the trusted matches that is right at the break-even."""
        if self.rate is None:
            return None
        right = self.trust.true_positives
        wrong = self.rate * (self.trust.false_positives + self.trust.true_negatives)
        return right / (right + wrong) if right + wrong else 0.0


def crossing(rates: Floats, areas: Floats, baseline: float) -> float | None:
    """The lowest rate at which the area falls below the baseline, on straight lines."""
    below = np.flatnonzero(areas < baseline)
    if not len(below):
        return None
    k = int(below[0])
    if k == 0:
        return float(rates[0])
    share = (areas[k - 1] - baseline) / (areas[k - 1] - areas[k])
    return float(rates[k - 1] + share * (rates[k] - rates[k - 1]))


def measure(case: Case, settings: Settings) -> BreakEven:
    """The break-even of a case."""
    return BreakEven(case, *_measured([case], (0, settings)))


def _measured(cases: Sequence[Case], job: tuple[int, Settings]) -> tuple[Any, ...]:
    """All but the case, which a task does not send back."""
    at, settings = job
    study = cases[at].study(settings)
    trust, right = study.trust, study.single_right
    # Closer at low rates, as most predictors have.
    rates = np.array(
        [0, 0.1, 0.5, 1.0]
        if settings.quick
        else [*np.arange(0, 0.2, 0.02), *np.arange(0.2, 1.01, 0.1)]
    )

    def area(rate: float, seed: int) -> float:
        trusted = noisy_predictor(
            right, true_positive_rate=trust.recall, false_positive_rate=min(rate, 1.0), seed=seed
        )
        return study.at(trusted=trusted).shown.curve.auc(UPTO)

    seeds = range(settings.draws)
    areas = np.array([[area(rate, seed) for seed in seeds] for rate in rates.tolist()])
    drawn = areas.mean(axis=1), areas.min(axis=1), areas.max(axis=1)
    both = (result.curve.auc(UPTO) for result in (study.baseline, study.shown))
    return trust, rates, *drawn, *both


def break_even(cases: Sequence[Case], settings: Settings) -> Exhibit:
    """The break-even of each case."""
    found = mapped(_measured, cases, [(at, settings) for at in range(len(cases))])
    measured = [BreakEven(case, *numbers) for case, numbers in zip(cases, found, strict=True)]
    rows: list[Sequence[Cell]] = []
    lines: list[Sequence[str]] = []
    evens: dict[Case, str] = {}
    for one in measured:
        names, trust = (one.case.dataset, one.case.technique), one.trust
        recall, fpr = trust.recall, trust.false_positive_rate
        consensus, baseline = one.consensus, one.baseline
        columns = (one.rates, one.areas, one.lowest, one.highest)
        points = zip(*(column.tolist() for column in columns), strict=True)
        rows += [(*names, "drawn", recall, *point) for point in points]
        rows.append((*names, "consensus", recall, fpr, consensus, consensus, consensus))
        rows.append((*names, "unweighted", None, None, baseline, baseline, baseline))
        rows.append((*names, "break-even", recall, one.rate, baseline, None, None))
        even, precision = (
            "none" if number is None else shown(number) for number in (one.rate, one.precision)
        )
        trusted = shown(recall), shown(fpr), even, shown(trust.precision), precision
        lines.append((*names, *trusted, shown(baseline), shown(consensus)))
        evens[one.case] = even
    of = {one.case: one for one in measured}
    pictures = pictured(
        "break_even",
        cases,
        lambda ax, case, theme: _draw(of[case], ax=ax, theme=theme),
        lambda case: (
            f"area by false positive rate from {of[case].areas[0]:.2f} at 0 to "
            f"{of[case].areas[-1]:.2f} at 1; unweighted {of[case].baseline:.2f}; break-even "
            f"{evens[case]}"
        ),
        x="false positive rate (share of the wrong single matches that are trusted)",
        y=f"area up to recall {UPTO:g}",
    )
    header = (
        "data set", "technique", "trusted, of the right", "trusted, of the wrong", "break-even",
        "right, of the trusted", "at break-even", "unweighted", "consensus",
    )  # fmt: skip
    caption = "The consensus's rates, and the break-even's; areas on the right"
    return Exhibit(
        "How good must a predictor be? The break-even",
        (
            f"Weight {WEIGHT:g}, L = {LENGTH}. Predictors are drawn that trust as large a share of "
            "the right matches as the consensus does, and a growing share of the wrong ones, "
            f"{settings.draws} draws each. The break-even is the rate at which the line falls "
            "below the unweighted sequence: trust wrong matches more often than that, and "
            "weighting costs. It moves with the data, so a rate that is fine on one route is not "
            "on another.",
            "The consensus is the mark. It need not lie on the line: it errs at places that look "
            "alike, and a drawn predictor errs anywhere.",
        ),
        pictures,
        tables=(Table("break-even", caption, header, lines, sorts=True),),
        points=_points(measured),
        name="break_even",
        header="dataset,technique,what,true_positive_rate,false_positive_rate,auc,lowest,highest",
        rows=rows,
    )


def _points(measured: Sequence[BreakEven]) -> list[str]:
    """The cases in which weighting by the consensus costs, or has no break-even."""
    costs = [
        f"{one.case.name} ({one.consensus - one.baseline:+.3f})"
        for one in measured
        if one.consensus < one.baseline
    ]
    never = [one.case.name for one in measured if one.rate is None]
    points = []
    if costs:
        points.append(
            f"The consensus costs in {len(costs)} of {len(measured)} cases: {listed(costs)}."
        )
    if never:
        points.append(f"Trusting every wrong match still gains: {listed(never)}.")
    return points


def _draw(one: BreakEven, *, ax: Axes, theme: Theme) -> Axes:
    colour = theme.trusted_right
    ax.fill_between(one.rates, one.lowest, one.highest, color=colour, alpha=0.13, linewidth=0)
    ax.plot(
        one.rates,
        one.areas,
        color=colour,
        linewidth=2.2,
        marker="o",
        markersize=4,
        clip_on=False,
        label="drawn predictors (mean, worst to best)",
    )
    dashes = (0, (4, 3))
    label = "unweighted sequence"
    ax.axhline(one.baseline, color=theme.muted, linestyle=dashes, linewidth=1.4, label=label)
    if one.rate is not None:
        label = "break-even"
        ax.axvline(one.rate, color=theme.muted, linestyle=":", linewidth=1.2, label=label)
    at = one.trust.false_positive_rate, one.consensus
    star(ax, at, theme.trusted_wrong, "the consensus", theme)
    ax.set_xlim(0, 1)
    ax.set_ylim(0, 1)
    return finish(ax)
