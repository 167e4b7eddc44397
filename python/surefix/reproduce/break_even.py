"""How often may a predictor trust wrong matches before weighting by it costs more than it gains?"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from surefix._core import Trust
from surefix.baselines import noisy_predictor
from surefix.baselines.distances import Floats
from surefix.plot.theme import Theme
from surefix.report.page import Picture, Table
from surefix.reproduce.case import UPTO, WEIGHT, Case, Settings
from surefix.reproduce.comparison import Cell, Comparison, drawn, shown, stem

__all__ = ["BreakEven", "compare", "crossing", "measure"]

LENGTH = 2


@dataclass(frozen=True, eq=False)
class BreakEven:
    """The area at each false positive rate, the true positive rate being the consensus's own.

    Attributes
    ----------
    trust : Trust
        The consensus, as measured.
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
        """The false positive rate of the break-even; None where weighting never costs."""
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
    """The lowest rate at which the area falls below the baseline, on straight lines between the
    measured ones.
    """
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
    trust, right = case.trust(), case.right()
    # Closer where most predictors are.
    rates = np.array(
        [0, 0.1, 0.5, 1.0]
        if settings.quick
        else [*np.arange(0, 0.2, 0.02), *np.arange(0.2, 1.01, 0.1)]
    )
    areas = np.array(
        [
            [
                case.evaluate(
                    case.weighted(
                        LENGTH,
                        trusted=noisy_predictor(
                            right,
                            true_positive_rate=trust.recall,
                            false_positive_rate=min(float(rate), 1.0),
                            seed=seed,
                        ),
                    ),
                    settings,
                ).auc(UPTO)
                for seed in range(settings.draws)
            ]
            for rate in rates
        ]
    )
    return BreakEven(
        case,
        trust,
        rates,
        areas.mean(axis=1),
        areas.min(axis=1),
        areas.max(axis=1),
        case.evaluate(case.unweighted(LENGTH), settings).auc(UPTO),
        case.evaluate(case.weighted(LENGTH), settings).auc(UPTO),
    )


def compare(cases: Sequence[Case], settings: Settings) -> Comparison:
    """The break-even of each case."""
    measured = [measure(case, settings) for case in cases]
    rows: list[Sequence[Cell]] = []
    for one in measured:
        names = one.case.dataset, one.case.technique
        points = zip(
            one.rates.tolist(),
            one.areas.tolist(),
            one.lowest.tolist(),
            one.highest.tolist(),
            strict=True,
        )
        rows += [(*names, "drawn", one.trust.recall, *point) for point in points]
        fpr, consensus = one.trust.false_positive_rate, one.consensus
        rows.append((*names, "consensus", one.trust.recall, fpr, consensus, consensus, consensus))
        rows.append((*names, "unweighted", None, None, one.baseline, one.baseline, one.baseline))
        rows.append((*names, "break-even", one.trust.recall, one.rate, one.baseline, None, None))
    return Comparison(
        "break_even",
        "How good must a predictor be? The break-even",
        (
            f"Weight {WEIGHT:g}, L = {LENGTH}. Predictors are drawn that trust as large a share of the right matches "
            f"as the consensus does, and a growing share of the wrong ones, {settings.draws} draws each. Where the "
            "line falls below the unweighted sequence is the break-even: trust wrong matches more often than that, and "
            "weighting costs. It moves with the data, so a rate that is fine on one route is not on another.",
            "The consensus is the mark. It need not lie on the line: it errs where places look alike, and a drawn "
            "predictor errs anywhere.",
        ),
        (
            "dataset",
            "technique",
            "what",
            "true_positive_rate",
            "false_positive_rate",
            "auc",
            "lowest",
            "highest",
        ),
        rows,
        {
            stem("break_even", one.case.dataset, one.case.technique): _picture(one)
            for one in measured
        },
        (_table(measured),),
        [_said(one) for one in measured],
    )


def _table(measured: Sequence[BreakEven]) -> Table:
    header = (
        "data set", "technique", "trusted, of the right", "trusted, of the wrong", "break-even",
        "right, of the trusted", "at break-even", "unweighted", "consensus",
    )  # fmt: skip
    lines = [
        (
            one.case.dataset,
            one.case.technique,
            shown(one.trust.recall),
            shown(one.trust.false_positive_rate),
            "none" if one.rate is None else shown(one.rate),
            shown(one.trust.precision),
            "none" if one.precision is None else shown(one.precision),
            shown(one.baseline),
            shown(one.consensus),
        )
        for one in measured
    ]
    caption = "The consensus's rates, and the break-even's; areas on the right"
    return Table("break-even", caption, header, lines)


def _said(one: BreakEven) -> str:
    fpr = one.trust.false_positive_rate
    name, change = (
        one.case.name,
        f"the area goes from {one.baseline:.3f} to {one.consensus:.3f} with it",
    )
    if one.rate is None:
        return f"{name}: no break-even, trusting every wrong match beside as many right ones still gains; {change}."
    if one.rate == 0:
        return f"{name}: weighting costs even where no wrong match is trusted; {change}."
    side = "below" if fpr < one.rate else "above"
    agrees = (one.consensus >= one.baseline) == (fpr < one.rate)
    luck = "" if agrees else ", the other way round: its errors are not like drawn ones"
    return (
        f"{name}: break-even at {one.rate:.3f} of the wrong matches trusted. The consensus trusts {fpr:.3f} of them, "
        f"{side} it; {change}{luck}."
    )


def _picture(one: BreakEven) -> Picture:
    even = "none" if one.rate is None else f"{one.rate:.3f}"
    return drawn(
        lambda ax, theme: _draw(ax, one, theme),
        f"Area by false positive rate for {one.case.name}: from {one.areas[0]:.2f} at 0 to {one.areas[-1]:.2f} at 1; "
        f"unweighted {one.baseline:.2f}; break-even {even}.",
        one.case.name,
    )


def _draw(ax: Axes, one: BreakEven, theme: Theme) -> Axes:
    ax.fill_between(
        one.rates, one.lowest, one.highest, color=theme.trusted_right, alpha=0.13, linewidth=0
    )
    ax.plot(
        one.rates,
        one.areas,
        color=theme.trusted_right,
        linewidth=2.2,
        marker="o",
        markersize=4,
        clip_on=False,
        label=f"drawn predictors that trust {one.trust.recall:.2f} of the right matches (mean, worst to best)",
    )
    ax.axhline(
        one.baseline,
        color=theme.muted,
        linestyle=(0, (4, 3)),
        linewidth=1.4,
        label="unweighted sequence",
    )
    if one.rate is not None:
        ax.axvline(
            one.rate,
            color=theme.muted,
            linestyle=":",
            linewidth=1.2,
            label=f"break-even, {one.rate:.3f}",
        )
    ax.plot(
        one.trust.false_positive_rate,
        one.consensus,
        linestyle="none",
        marker="*",
        markersize=15,
        color=theme.trusted_wrong,
        markeredgecolor=theme.paper,
        zorder=6,
        clip_on=False,
        label=f"the consensus: trusts {one.trust.false_positive_rate:.3f} of the wrong matches",
    )
    ax.set_xlim(0, 1)
    ax.set_ylim(0, 1)
    ax.set_xlabel("false positive rate (share of the wrong single matches that are trusted)")
    ax.set_ylabel(f"area under the precision-recall curve up to recall {UPTO:g}")
    ax.grid(linewidth=0.8)
    ax.set_axisbelow(True)
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1.0), alignment="left")
    return ax
