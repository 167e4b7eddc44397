"""All comparisons, one after the other, and the page that holds them."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from surefix import __version__
from surefix.errors import SurefixValueError
from surefix.machine import machine
from surefix.report.page import Section, Tile, page
from surefix.report.staged import PAGE, staged
from surefix.reproduce import ablation, break_even, curves, false_positives, sweep, table, timing
from surefix.reproduce.case import Case, Settings
from surefix.reproduce.comparison import Comparison, csv_text, stem
from surefix.reproduce.paper import PaperRow

__all__ = ["STEPS", "comparisons", "write_report"]

STEPS = 9

RECALLS = (
    (
        "recall \u201ccorrect\u201d",
        "accepted correct matches / all correct matches of the same method. The paper's wording, the default here.",
    ),
    (
        "recall \u201cplace_exists\u201d",
        "accepted correct matches / all queries that have a true place.",
    ),
    (
        "recall \u201crejected\u201d",
        "accepted correct matches / (those and all rejected queries). The authors' earlier code.",
    ),
)


def comparisons(
    cases: Sequence[Case], settings: Settings, paper: Sequence[PaperRow] | None = None
) -> Iterator[Comparison]:
    """Each comparison as soon as it is made: ``STEPS`` of them.

    Raises
    ------
    SurefixError
        Where a case does not do.
    """
    _check_distinct(cases)
    rows = [table.measure(case, settings) for case in cases]
    yield table.compare(rows, paper, settings)
    yield curves.sequences(rows, settings)
    yield curves.single_frames(cases, settings)
    yield curves.perfect_prediction(cases, settings)
    yield sweep.compare(cases, settings)
    yield break_even.compare(cases, settings)
    yield ablation.compare(cases, settings)
    yield false_positives.compare(rows, settings)
    yield timing.compare(machine(), settings)


def write_report(
    folder: Path,
    made: Sequence[Comparison],
    cases: Sequence[Case],
    settings: Settings,
    *,
    problems: Sequence[str] = (),
    command: str = "surefix reproduce",
) -> Path:
    """Writes the page, a PNG of each picture and a CSV of each comparison; returns the path of the
    page.

    Raises
    ------
    OSError
        Where a file cannot be written.
    """
    with staged(folder) as inside:
        for comparison in made:
            text = csv_text(comparison.header, comparison.rows)
            (inside / f"{comparison.name}.csv").write_text(text, encoding="utf-8", newline="")
            for name, picture in comparison.pictures.items():
                (inside / f"{name}.png").write_bytes(picture.light)
        text = page(
            "The paper, made again",
            _lead(cases, settings, problems),
            (),
            _tiles(made[0], len(cases)),
            [*map(_section, made), _data(cases, problems), _made(settings, command)],
        )
        (inside / PAGE).write_text(text, encoding="utf-8")
    return folder / PAGE


def _check_distinct(cases: Sequence[Case]) -> None:
    """Files are named after cases, so each needs a name of its own."""
    names = [stem(case.dataset, case.technique) for case in cases]
    for case, name in zip(cases, names, strict=True):
        if names.count(name) > 1:
            raise SurefixValueError(
                f"cases: expected names that differ in letters or digits, got {case.name} twice"
            )


def _lead(cases: Sequence[Case], settings: Settings, problems: Sequence[str]) -> Sequence[str]:
    drawn = [case for case in cases if case.generated]
    if len(drawn) == len(cases):
        what = (
            "None of the paper's data was given, so all of this is on a generated route: a drawn world, not a real "
            "one. It shows what the method does and that it works; its numbers are not the paper's, and no real "
            "route's. Give the data sets with --data."
        )
    elif drawn:
        what = f"{len(drawn)} of the {len(cases)} cases are generated: a drawn world. Their names say so."
    else:
        what = f"On {len(cases)} cases of recorded data, none of it generated."
    lead = [
        "Carson, Ford and Milford, \u201cUnsupervised Quality Prediction for Improved Single-Frame and Weighted "
        "Sequential Visual Place Recognition\u201d, ICRA 2023 (arXiv 2307.01464): its table and its figures, computed "
        "anew by surefix, on the data that is here.",
        what,
    ]
    if problems:
        lead.append(
            f"{len(problems)} of the data sets or files found could not be used: see the end."
        )
    if settings.quick:
        lead.append(
            "Made with --quick: few bootstrap samples, few steps. To see that it works, not to quote."
        )
    return lead


def _tiles(first: Comparison, cases: int) -> Sequence[Tile]:
    column = list(first.header).index("verdict")
    verdicts = [row[column] for row in first.rows]
    return tuple(
        Tile(verdict, str(verdicts.count(verdict)), label, f"of {cases} rows of Table I")
        for verdict, label in (
            ("wins", "weighting wins, its interval above 0"),
            ("loses", "weighting loses, its interval below 0"),
            ("undecided", "undecided, the interval holds 0"),
        )
    )


def _section(comparison: Comparison) -> Section:
    return Section(
        comparison.title,
        comparison.paragraphs,
        tuple(comparison.pictures.values()),
        tables=comparison.tables,
        points=comparison.points,
    )


def _data(cases: Sequence[Case], problems: Sequence[str]) -> Section:
    rows = []
    for case in cases:
        places, queries = case.D.shape
        words = (
            f"{places} places, {queries} queries; correct is {case.correct_means}; {case.source}",
            *case.notes,
        )
        rows.append((case.name, ". ".join(word.rstrip(".") for word in words) + "."))
    missing = [f"Not used: {problem}" for problem in problems]
    return Section(
        "The data",
        ("Everything that was found, and what became of it.",),
        rows=rows,
        points=missing,
    )


def _made(settings: Settings, command: str) -> Section:
    rows = (
        *RECALLS,
        ("recall on this page", f"\u201c{settings.recall}\u201d, except where a label says otherwise"),
        ("area", "trapezoids through the lowest precision at each recall, the first held back to recall 0, "
         "divided by the recall it goes up to; a sequence's warm-up is left out"),
        ("intervals", f"block bootstrap over queries, blocks of the root of their number, {settings.samples} samples"),
        ("SAD", "grey, 64 x 32 pixels, normalized in patches of 8 x 8, a byte each; mean absolute difference"),
        ("made with", f"surefix {__version__}: {command}"),
        ("on", machine()),
    )  # fmt: skip
    return Section(
        "How this was made",
        ("Beside this page: a PNG of each picture, a CSV of each section.",),
        rows=rows,
    )
