"""All exhibits, one after the other, and the page that holds them."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from surefix import __version__
from surefix.errors import mismatch
from surefix.machine import machine
from surefix.report import sections
from surefix.report.page import Section, Tile, write
from surefix.report.tables import write_csv
from surefix.reproduce.break_even import break_even
from surefix.reproduce.case import Case, Settings
from surefix.reproduce.curves import perfect_prediction, sequences, single_frames
from surefix.reproduce.exhibit import Exhibit, stem
from surefix.reproduce.paper import PaperRow
from surefix.reproduce.sweeps import ablation, weight_sweep
from surefix.reproduce.table import false_positives, table_1
from surefix.reproduce.timing import execution_time

__all__ = ["STEPS", "exhibits", "write_report"]

STEPS = 9


def exhibits(
    cases: Sequence[Case], settings: Settings, paper: Sequence[PaperRow] | None = None
) -> Iterator[Exhibit]:
    """Each exhibit as soon as it is made: ``STEPS`` of them.

    Raises
    ------
    SurefixError
        If two cases have one name, or a case does not do.
    """
    # Files are named after cases, so each needs a name of its own.
    names = [stem(case.dataset, case.technique) for case in cases]
    for case, name in zip(cases, names, strict=True):
        if names.count(name) > 1:
            raise mismatch("cases", "names that differ in letters or digits", f"{case.name} twice")
    yield table_1(cases, paper, settings)
    for curves in (sequences, single_frames, perfect_prediction):
        yield curves(cases, settings)
    for make in (weight_sweep, break_even, ablation, false_positives):
        yield make(cases, settings)
    yield execution_time(machine(), settings)


def write_report(
    folder: Path,
    made: Sequence[Exhibit],
    cases: Sequence[Case],
    settings: Settings,
    *,
    problems: Sequence[str] = (),
    command: str = "surefix reproduce",
) -> Path:
    """Writes the page, a PNG of each picture and a CSV of each exhibit; returns the page's path."""

    def tables(inside: Path) -> None:
        for exhibit in made:
            write_csv(inside / f"{exhibit.name}.csv", exhibit.header, exhibit.rows)

    return write(
        folder,
        "The paper, made again",
        _lead(cases, settings, problems),
        (),
        _tiles(made[0], len(cases)),
        [*made, _data(cases, settings, problems), _made(settings, command)],
        tables,
        contents=True,
        identity=sections.identity("surefix reproduce"),
    )


def _lead(cases: Sequence[Case], settings: Settings, problems: Sequence[str]) -> Sequence[str]:
    drawn = [case for case in cases if case.generated]
    if len(drawn) == len(cases):
        data = (
            "None of the paper's data was given, so all of this is on a generated route: a drawn "
            "world, not a real one. It shows what the method does and that it works; its numbers "
            "are not the paper's, and no real route's. Give the data sets with --data."
        )
    elif drawn:
        count = f"{len(drawn)} of the {len(cases)}"
        data = f"{count} cases are generated: a drawn world. Their names say so."
    else:
        data = f"On {len(cases)} cases of recorded data, none of it generated."
    lead = [
        "Carson, Ford and Milford, \u201cUnsupervised Quality Prediction for Improved Single-Frame "
        "and Weighted Sequential Visual Place Recognition\u201d, ICRA 2023 (arXiv 2307.01464): its "
        "table and its figures, computed anew by surefix, on the data that is here.",
        data,
    ]
    if problems:
        lead.append(
            f"{len(problems)} of the data sets or files found could not be used: see the end."
        )
    if settings.quick:
        lead.append(
            "Made with --quick: few bootstrap samples, few steps. To see that it works, not to "
            "quote."
        )
    return lead


def _tiles(first: Exhibit, cases: int) -> Sequence[Tile]:
    column = first.header.split(",").index("verdict")
    verdicts = [row[column] for row in first.rows]
    return tuple(
        Tile(verdict, str(verdicts.count(verdict)), label, f"of {cases} rows of Table I")
        for verdict, label in (
            ("wins", "weighting wins, its interval above 0"),
            ("loses", "weighting loses, its interval below 0"),
            ("level", "level, the interval holds 0"),
        )
    )


def _data(cases: Sequence[Case], settings: Settings, problems: Sequence[str]) -> Section:
    rows = []
    for case in cases:
        places, queries = case.D.shape
        correct = case.study(settings).correct_means
        words = f"{places} places, {queries} queries; correct is {correct}; {case.source}"
        parts = (words, *case.notes)
        rows.append((case.name, ". ".join(part.rstrip(".") for part in parts) + "."))
    missing = [f"Not used: {problem}" for problem in problems]
    return Section(
        "The data", ("All data that was found, used or not.",), facts=rows, points=missing
    )


def _made(settings: Settings, command: str) -> Section:
    rows = (
        *((f"recall \u201c{name}\u201d", words) for name, words in sections.RECALLS.items()),
        ("recall on this page", f"\u201c{settings.recall}\u201d, unless a label says otherwise"),
        (
            "area",
            "trapezoids through the lowest precision at each recall, the first held back to recall "
            "0, divided by the recall it goes up to; a sequence's warm-up is left out",
        ),
        (
            "intervals",
            "block bootstrap over queries, blocks as long as errors last, "
            f"{settings.samples} samples",
        ),
        (
            "SAD",
            "grey, 64 x 32 pixels, normalized in patches of 8 x 8, a byte each; mean absolute "
            "difference",
        ),
        ("made with", f"surefix {__version__}: {command}"),
        ("on", machine()),
    )
    return Section(
        "How this was made",
        ("Beside this page: a PNG of each picture, a CSV of each section.",),
        facts=rows,
    )
