"""The length of the sequence, from 2 to 9."""

from collections.abc import Sequence

from surefix import plot
from surefix.report.page import Picture, Table
from surefix.reproduce.case import UPTO, WEIGHT, Case, Settings
from surefix.reproduce.comparison import Comparison, drawn, listed, shown, stem

__all__ = ["LENGTHS", "compare"]

LENGTHS = range(2, 10)


def compare(cases: Sequence[Case], settings: Settings) -> Comparison:
    """Every length of every case."""
    rows, lines, pictures, losses = [], [], {}, []
    for case in cases:
        areas: dict[str, list[float]] = {"weighted": [], "unweighted": []}
        for length in LENGTHS:
            unweighted = case.evaluate(case.unweighted(length), settings)
            weighted = case.evaluate(case.weighted(length), settings)
            low, high = weighted.auc_difference_interval(unweighted, UPTO, samples=settings.samples)
            before, after = unweighted.auc(UPTO), weighted.auc(UPTO)
            areas["weighted"].append(after)
            areas["unweighted"].append(before)
            rows.append(
                (case.dataset, case.technique, length, before, after, after - before, low, high)
            )
            if after < before:
                change = f"{before:.3f} to {after:.3f}, interval {low:+.3f} to {high:+.3f}"
                losses.append(f"{case.name}, L = {length} ({change})")
        lines += [(case.name, name, *map(shown, values)) for name, values in areas.items()]
        pictures[stem("ablation", case.dataset, case.technique)] = _picture(case, areas)
    total = len(cases) * len(LENGTHS)
    header = ("case", "sequence", *(f"L = {k}" for k in LENGTHS))
    said = f"In {len(losses)} of the {total} cases and lengths the weighted area is the smaller"
    return Comparison(
        "ablation",
        "The length of the sequence",
        (
            f"The area up to recall {UPTO:g} for L from {LENGTHS[0]} to {LENGTHS[-1]} queries, unweighted and weighted "
            f"with w = {WEIGHT:g}. A longer sequence waits longer for its first answer, and asks more of a robot to "
            "move as the first drive did.",
            f"{said}{': ' + listed(losses) if losses else ''}.",
        ),
        ("dataset", "technique", "length", "unweighted", "weighted", "difference", "low", "high"),
        rows,
        pictures,
        (Table("ablation", f"Area up to recall {UPTO:g}", header, lines),),
    )


def _picture(case: Case, areas: dict[str, list[float]]) -> Picture:
    text = "; ".join(f"{name} {', '.join(map(shown, values))}" for name, values in areas.items())
    return drawn(
        lambda ax, theme: plot.ablation(ax, LENGTHS, areas, upto=UPTO, theme=theme),
        f"Area by sequence length for {case.name}, L from {LENGTHS[0]} to {LENGTHS[-1]}: {text}.",
        case.name,
    )
