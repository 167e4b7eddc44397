"""Table I: the areas up to 20 % recall and their difference; the false positives behind it."""

from collections.abc import Sequence
from dataclasses import replace

from surefix._ray import mapped
from surefix.report.multiples import Interval, forest
from surefix.report.page import Table
from surefix.report.tables import count
from surefix.reproduce.case import LENGTH, WEIGHT, Case, Settings, run_cases
from surefix.reproduce.exhibit import Cell, Exhibit, listed, shown
from surefix.reproduce.paper import PUBLISHED, PaperRow
from surefix.study import UPTO, Result
from surefix.study.scenarios import RECORDED

__all__ = ["false_positives", "table_1"]

TRACKERS = ("track_steady", "track_free", "track_any", "track_odometry", "fused")
# The errors of the odometry that is made of the truth: its scale, and a step's deviation.
ODOMETRY = {"scale_error": 0.03, "noise": 0.1}


def table_1(cases: Sequence[Case], paper: Sequence[PaperRow] | None, settings: Settings) -> Exhibit:
    """The table of all cases, beside the paper's own numbers, or those that the user gave."""
    published = PUBLISHED if paper is None else paper
    rows: list[Sequence[Cell]] = []
    lines: list[Sequence[str]] = []
    tracked: list[Sequence[str]] = []
    seen = []
    run_cases(cases, settings)
    tracks_of = mapped(_tracks, cases, [(at, settings) for at in range(len(cases))])
    for case, tracks in zip(cases, tracks_of, strict=True):
        own = next(
            (row for row in published if row.is_for(case.technique, case.dataset, *case.aliases)),
            None,
        )
        seen.append(own)
        both = case.study(settings).results
        names, weighted = (case.dataset, case.technique), both[1]
        curves, areas = [result.curve for result in both], [result.area[0] for result in both]
        correct, reached = [c.correct for c in curves], [c.max_recall for c in curves]
        numbers = *case.D.shape, *correct, *areas, *tracks, *weighted.difference, *reached
        theirs = (None, None) if own is None else (own.baseline, own.weighted)
        rows.append((*names, *numbers, weighted.outcome, *theirs))
        difference, low, high = weighted.difference
        apart = f"{difference:+.3f}", f"{low:+.3f}\u00a0to\u00a0{high:+.3f}", weighted.outcome
        lines.append((*names, str(case.D.shape[1]), *map(shown, areas), *apart, _pair(own)))
        tracked.append((*names, *map(shown, (areas[0], *tracks))))
    absent = [own for own in published if own not in seen]
    for own in absent:
        names = own.dataset, own.technique
        rows.append((*names, *[None] * 16, "not run here", own.baseline, own.weighted))
        lines.append((*names, *["\u2013"] * 5, "not run here", _pair(own)))
    header = (
        "data set", "technique", "queries", "baseline", "weighted", "difference", "95 % interval",
        "weighting", "paper: baseline, weighted",
    )  # fmt: skip
    trackers = (
        "data set", "technique", "baseline", "steady", "free", "any", "any, odometry",
        "any, techniques fused",
    )  # fmt: skip
    caption = f"Area up to recall {UPTO:g}, L = {LENGTH}, w = {WEIGHT:g}"
    areas_of = {
        case.name: {name: result.area for name, result in _named(case, settings).items()}
        for case in cases
    }
    picture = forest(
        areas_of,
        f"Areas with their intervals: {'; '.join(_said(case, settings) for case in cases)}.",
        x=f"area up to recall {UPTO:g}, and its 95 % interval",
        caption="Each area with its own interval. Whether two of a pair differ is told by the "
        "interval of their difference, in the table.",
    )
    return Exhibit(
        "Table I: the area up to 20 % recall",
        _paragraphs(cases, paper, absent, settings),
        {"table_1.png": picture},
        tables=(
            Table("table-1", caption, header, lines, sorts=True),
            Table(
                "table-1-tracker",
                f"The tracker: area up to recall {UPTO:g}",
                trackers,
                tracked,
                sorts=True,
            ),
        ),
        points=_points(cases, settings),
        name="table_1",
        header="dataset,technique,places,queries,correct_unweighted,correct_weighted,baseline,"
        f"weighted,{','.join(TRACKERS)},difference,low,high,reached_recall_baseline,"
        "reached_recall_weighted,verdict,"
        "paper_baseline,paper_weighted",
        rows=rows,
    )


def _pair(own: PaperRow | None) -> str:
    return "\u2013" if own is None else f"{shown(own.baseline)}, {shown(own.weighted)}"


def _paragraphs(
    cases: Sequence[Case],
    paper: Sequence[PaperRow] | None,
    absent: Sequence[PaperRow],
    settings: Settings,
) -> Sequence[str]:
    if paper is None:
        own = (
            f"The paper's column is its Table I (arXiv 2307.01464): {len(PUBLISHED)} rows, of "
            f"which {len(absent)} were not run here. It does not publish the settings of its SAD, "
            "and areas on other extracts of a data set need not agree with it."
        )
    else:
        own = (
            f"The paper's column is from the file given as --paper: {len(paper)} rows, of which "
            f"{len(absent)} were not run here."
        )
        if absent:
            names = dict.fromkeys(name for case in cases for name in (case.dataset, *case.aliases))
            techniques = dict.fromkeys(case.technique for case in cases)
            own += (
                f" A row is matched by its names. The data sets here: {'; '.join(names)}. The "
                f"techniques: {'; '.join(techniques)}. Small and large letters are the same."
            )
    return (
        f"The area under the precision-recall curve up to recall {UPTO:g}, divided by it: 1 is "
        f"flawless. Baseline: the unweighted sequence of L = {LENGTH} queries. Weighted: the same, "
        f"with trusted matches weighted, w = {WEIGHT:g}, the floor being the least distance of the "
        "whole matrix. Recall is "
        f"\u201c{settings.recall}\u201d: see the end.",
        "The interval is the middle 95 % of the difference (weighted minus baseline) when blocks "
        f"of consecutive queries are drawn anew {settings.samples} times. If it holds 0, the two "
        "are level: the data do not tell which is better. One interval in twenty misses by chance.",
        own,
        "The tracker is a Bayes filter over the places: at one place a query (steady), at 0 to 2 "
        "(free), or at any speed. Its odometry is made of the truth, 3 % too long, each step with "
        "an error of 10 %. Fused: with the other techniques of the same data set.",
    )


def _tracks(cases: Sequence[Case], job: tuple[int, Settings]) -> Sequence[float | None]:
    """The areas of the trackers; None for fused if the data set has one technique."""
    at, settings = job
    case = cases[at]
    study = case.study(settings).driven(RECORDED, 0, **ODOMETRY)
    others = [
        other.D
        for other in cases
        if other is not case and (other.dataset, other.D.shape) == (case.dataset, case.D.shape)
    ]
    study = replace(study, context=replace(study.context, techniques=others or None))
    return [
        None if name == "fused" and not others else study[name].curve.auc(UPTO) for name in TRACKERS
    ]


def _points(cases: Sequence[Case], settings: Settings) -> Sequence[str]:
    """The cases in which weighting loses, wins or is level."""
    weighted = {case: case.study(settings).shown for case in cases}
    points = []
    for words, outcome in (
        ("Weighting loses in", "loses"),
        ("Weighting wins in", "wins"),
        ("Level, the interval holds 0, in", "level"),
    ):
        which = [case for case, result in weighted.items() if result.outcome == outcome]
        names = [f"{case.name} ({weighted[case].difference[0]:+.3f})" for case in which]
        some = f": {listed(names)}" if which and outcome != "level" else ""
        points.append(f"{words} {len(which)} of {len(cases)} rows{some}.")
    short = [
        f"{case.name} ({name}, ends at recall {curve.max_recall:.3f})"
        for case in cases
        for name, result in _named(case, settings).items()
        if (curve := result.curve).max_recall < UPTO
    ]
    if short:
        points.append(
            f"Curves that end before recall {UPTO:g}, and so have no area beyond: {listed(short)}."
        )
    return points


def _named(case: Case, settings: Settings) -> dict[str, Result]:
    return dict(zip(("unweighted", "weighted"), case.study(settings).results, strict=True))


def _said(case: Case, settings: Settings) -> str:
    plain, weighted = case.study(settings).results
    difference, low, high = weighted.difference
    return (
        f"{case.name}, {plain.area[0]:.3f} to {weighted.area[0]:.3f} ({difference:+.3f}, interval "
        f"{low:+.3f} to {high:+.3f})"
    )


def false_positives(cases: Sequence[Case], settings: Settings) -> Exhibit:
    """The wrong matches that are accepted by 20 % recall, behind each row of Table I."""
    rows: list[tuple[str, str, int | None, int | None, int, int]] = []
    counts: dict[str, dict[str, Interval]] = {}
    fewer = more = same = 0
    for case in cases:
        plain, weighted = (result.curve for result in case.study(settings).results)
        before, after = (curve.false_positives_at(UPTO) for curve in (plain, weighted))
        if before is not None and after is not None:
            fewer, more = fewer + (after < before), more + (after > before)
            same += after == before
        correct = plain.correct, weighted.correct
        rows.append((case.dataset, case.technique, before, after, *correct))
        counts[case.name] = {
            name: (number, None, None)
            for name, number in (("unweighted", before), ("weighted", after))
        }
    rest = len(cases) - fewer - more - same

    words = {f"{row[0]}, {row[1]}": [count(row[2]), count(row[3])] for row in rows}
    text = "; ".join(f"{name}: {both[0]}, {both[1]} weighted" for name, both in words.items())
    picture = forest(
        counts,
        f"Wrong matches accepted by recall {UPTO:g}, unweighted and weighted: {text}.",
        x=f"false positives at recall {UPTO:g} (wrong matches accepted)",
        limits=(0, None),
        none="never there",
    )
    lines = [(name, *both) for name, both in words.items()]
    header = ("case", "unweighted", "weighted")
    caption = f"Wrong matches accepted by recall {UPTO:g}"
    return Exhibit(
        "False positives at 20 % recall",
        (
            f"The wrong matches that are accepted by the time that recall {UPTO:g} is reached "
            f"(L = {LENGTH}, recall is \u201c{settings.recall}\u201d). Weighting makes them fewer "
            f"in {fewer}, more in {more} and leaves their number in {same} of {len(cases)} rows; "
            f"in {rest} a curve ends before that recall.",
        ),
        {"false_positives.png": picture},
        tables=(Table("false-positives", caption, header, lines, sorts=True),),
        name="false_positives",
        header="dataset,technique,unweighted,weighted,correct_unweighted,correct_weighted",
        rows=rows,
    )
