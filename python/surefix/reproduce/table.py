"""Table I: the area up to 20 % recall, baseline and weighted, with the interval of the
difference.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from textwrap import fill

from surefix import plot
from surefix._core import Evaluation
from surefix.plot import Estimate
from surefix.report.page import Picture, Table
from surefix.reproduce.case import UPTO, WEIGHT, Case, Settings
from surefix.reproduce.comparison import Comparison, drawn, listed, shown
from surefix.reproduce.paper import PaperRow

__all__ = ["LABEL", "LENGTH", "Row", "compare", "measure"]

LENGTH = 2
# More in one picture cannot be read.
ROWS_A_PICTURE = 8
# Letters in a line of a label: a longer one leaves the picture no room.
LABEL = 48
HEADER = (
    "dataset", "technique", "places", "queries", "correct_unweighted", "correct_weighted", "baseline", "weighted",
    "difference", "low", "high", "reached_recall_baseline", "reached_recall_weighted", "verdict", "paper_baseline",
    "paper_weighted",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Row:
    """A case with its two curves, and the 95 % interval of the difference of their areas."""

    case: Case
    unweighted: Evaluation
    weighted: Evaluation
    interval: tuple[float, float]
    intervals: tuple[tuple[float, float], tuple[float, float]]

    @cached_property
    def baseline_area(self) -> float:
        """The area of the unweighted sequence."""
        return self.unweighted.auc(UPTO)

    @cached_property
    def weighted_area(self) -> float:
        """The area of the weighted sequence."""
        return self.weighted.auc(UPTO)

    @property
    def difference(self) -> float:
        """What weighting adds."""
        return self.weighted_area - self.baseline_area

    @property
    def verdict(self) -> str:
        """Whether weighting wins or loses, where the interval leaves no doubt."""
        low, high = self.interval
        return "wins" if low > 0 else "loses" if high < 0 else "undecided"

    def __str__(self) -> str:
        low, high = self.interval
        change = f"{self.baseline_area:.3f} to {self.weighted_area:.3f}"
        return f"{self.case.name}, {change} ({self.difference:+.3f}, interval {low:+.3f} to {high:+.3f})"


def measure(case: Case, settings: Settings) -> Row:
    """The row of a case."""
    unweighted = case.evaluate(case.unweighted(LENGTH), settings)
    weighted = case.evaluate(case.weighted(LENGTH), settings)
    return Row(
        case,
        unweighted,
        weighted,
        weighted.auc_difference_interval(unweighted, UPTO, samples=settings.samples),
        (
            unweighted.auc_interval(UPTO, samples=settings.samples),
            weighted.auc_interval(UPTO, samples=settings.samples),
        ),
    )


def compare(
    rows: Sequence[Row], paper: Sequence[PaperRow] | None, settings: Settings
) -> Comparison:
    """The table of all cases, beside the paper's own numbers where the user gave them."""
    cells: list[tuple[str | int | float | None, ...]] = []
    seen = []
    for row in rows:
        own = _paper_row(row.case, paper)
        seen.append(own)
        cells.append(
            (
                row.case.dataset,
                row.case.technique,
                *row.case.D.shape,
                row.unweighted.correct,
                row.weighted.correct,
                row.baseline_area,
                row.weighted_area,
                row.difference,
                *row.interval,
                row.unweighted.max_recall,
                row.weighted.max_recall,
                row.verdict,
                None if own is None else own.baseline,
                None if own is None else own.weighted,
            )
        )
    absent = [own for own in paper or () if own not in seen]
    cells += [
        (own.dataset, own.technique, *[None] * 11, "not run here", own.baseline, own.weighted)
        for own in absent
    ]
    return Comparison(
        "table_1",
        "Table I: the area up to 20 % recall",
        _paragraphs(rows, paper, absent, settings),
        HEADER,
        cells,
        {
            f"table_1_{number}" if number > 1 else "table_1": _picture(part)
            for number, part in _parts(rows)
        },
        (_table(rows, seen, absent),),
        _points(rows),
    )


def _paper_row(case: Case, paper: Sequence[PaperRow] | None) -> PaperRow | None:
    return next(
        (row for row in paper or () if row.is_for(case.technique, case.dataset, *case.aliases)),
        None,
    )


def _paragraphs(
    rows: Sequence[Row],
    paper: Sequence[PaperRow] | None,
    absent: Sequence[PaperRow],
    settings: Settings,
) -> Sequence[str]:
    if paper is None:
        own = (
            "The column for the paper's own numbers is empty: surefix does not have them. They are in Table I of "
            "arXiv 2307.01464; write them into a CSV file with the columns dataset,technique,baseline,weighted and "
            "give it as --paper FILE."
        )
    else:
        own = (
            f"The paper's column is what the file given as --paper holds: {len(paper)} rows, of which "
            f"{len(absent)} were not run here."
        )
        if absent:
            names = dict.fromkeys(
                name for row in rows for name in (row.case.dataset, *row.case.aliases)
            )
            techniques = dict.fromkeys(row.case.technique for row in rows)
            own += (
                f" A row is matched by its names. The data sets here: {'; '.join(names)}. The techniques: "
                f"{'; '.join(techniques)}. Small and large letters are the same."
            )
    return (
        f"The area under the precision-recall curve up to recall {UPTO:g}, divided by it: 1 is flawless. Baseline: "
        f"the unweighted sequence of L = {LENGTH} queries. Weighted: the same, with trusted matches weighted, "
        f"w = {WEIGHT:g}, the floor being the least distance of the whole matrix. Recall is "
        f"\u201c{settings.recall}\u201d: see the end.",
        "The interval is the middle 95 % of the difference (weighted minus baseline) when blocks of consecutive "
        f"queries are drawn anew {settings.samples} times. Where it holds 0, the data do not tell which is better; "
        "one interval in twenty misses by chance.",
        own,
    )


def _points(rows: Sequence[Row]) -> Sequence[str]:
    """Who wins and who loses, and in the undecided rows which way they lean."""
    points = []
    for words, which in (
        ("Weighting loses in", [row for row in rows if row.verdict == "loses"]),
        ("Weighting wins in", [row for row in rows if row.verdict == "wins"]),
        (
            "Undecided, the interval holds 0, and the weighted area is the smaller in",
            [row for row in rows if row.verdict == "undecided" and row.difference < 0],
        ),
        (
            "Undecided, the interval holds 0, and the weighted area is the larger or the same in",
            [row for row in rows if row.verdict == "undecided" and row.difference >= 0],
        ),
    ):
        some = f": {listed(list(map(str, which)))}" if which else ""
        points.append(f"{words} {len(which)} of {len(rows)} rows{some}.")
    short = [
        f"{row.case.name} ({which}, ends at recall {curve.max_recall:.3f})"
        for row in rows
        for which, curve in (("unweighted", row.unweighted), ("weighted", row.weighted))
        if curve.max_recall < UPTO
    ]
    if short:
        points.append(
            f"Curves that end before recall {UPTO:g}, and so have no area beyond: {listed(short)}."
        )
    return points


def _table(
    rows: Sequence[Row], seen: Sequence[PaperRow | None], absent: Sequence[PaperRow]
) -> Table:
    lines: list[tuple[str, ...]] = [
        (
            row.case.dataset,
            row.case.technique,
            str(row.case.D.shape[1]),
            shown(row.baseline_area),
            shown(row.weighted_area),
            f"{row.difference:+.3f}",
            f"{row.interval[0]:+.3f}\u00a0to\u00a0{row.interval[1]:+.3f}",
            row.verdict,
            _pair(own),
        )
        for row, own in zip(rows, seen, strict=True)
    ]
    lines += [
        (own.dataset, own.technique, *["\u2013"] * 5, "not run here", _pair(own)) for own in absent
    ]
    header = (
        "data set", "technique", "queries", "baseline", "weighted", "difference", "95 % interval", "weighting",
        "paper: baseline, weighted",
    )  # fmt: skip
    return Table(
        "table-1", f"Area up to recall {UPTO:g}, L = {LENGTH}, w = {WEIGHT:g}", header, lines
    )


def _pair(own: PaperRow | None) -> str:
    return "\u2013" if own is None else f"{shown(own.baseline)}, {shown(own.weighted)}"


def _parts(rows: Sequence[Row]) -> Sequence[tuple[int, Sequence[Row]]]:
    starts = range(0, len(rows), ROWS_A_PICTURE)
    return [
        (number, rows[start : start + ROWS_A_PICTURE]) for number, start in enumerate(starts, 1)
    ]


def _picture(rows: Sequence[Row]) -> Picture:
    estimates: dict[str, Estimate] = {}
    for row in rows:
        for name, area, interval in zip(
            ("unweighted", "weighted"),
            (row.baseline_area, row.weighted_area),
            row.intervals,
            strict=True,
        ):
            estimates[fill(f"{row.case.name}: {name}", LABEL)] = (area, *interval)
    return drawn(
        lambda ax, theme: plot.auc_intervals(ax, estimates, upto=UPTO, theme=theme),
        f"Areas with their intervals: {'; '.join(map(str, rows))}.",
        "Each area with its own interval. Whether two of a pair differ is told by the interval of their difference.",
        (8.6, 1.0 + 0.36 * len(estimates)),
    )
