"""``surefix reproduce``: the paper's table and figures, on the data that is there."""

import shlex
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn

from surefix import SurefixValueError
from surefix._extra import drawing
from surefix._ray import hold
from surefix._terminal import Console, say
from surefix.cli.flags import with_ray
from surefix.study.study import Recall

if TYPE_CHECKING:
    from surefix.reproduce import Case, Settings

__all__ = ["reproduce"]


@with_ray
def reproduce(
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", help="The folder to write; an earlier report's files in it are replaced."
        ),
    ] = Path("out/reproduce"),
    data: Annotated[
        Path | None,
        typer.Option(
            help="A folder with data sets as their publishers ship them: Gardens Point, Nordland, "
            "4Seasons, RobotCar, or reference/ and query/ with ground_truth.csv and matrices/. "
            "Each is run on every pair that is there: its first traverse against each other."
        ),
    ] = None,
    pair: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SET=REFERENCE/QUERY",
            help="Of a data set in --data only this pair of traverses, as "
            "nordland=summer/winter. May be given again.",
        ),
    ] = None,
    matrix: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=FILE[,TRUTH]",
            help="Ready distances of any technique, a .npy with a row a place and a column a "
            "query, and the truth, if it is not the identity; NAME as DATASET/TECHNIQUE. May be "
            "given again.",
        ),
    ] = None,
    similarity: Annotated[
        bool,
        typer.Option(
            "--similarity", help="The matrices of --matrix hold similarities: distance is 1 - that."
        ),
    ] = False,
    paper: Annotated[
        Path | None,
        typer.Option(
            help="Other numbers for the table than the paper's own: a CSV with "
            "the columns dataset, technique, baseline, weighted; dataset as the table names it, or "
            "gardens_point, nordland, four_seasons, robotcar."
        ),
    ] = None,
    recall: Annotated[Recall, typer.Option(help="The convention of recall.")] = "correct",
    quick: Annotated[
        bool, typer.Option("--quick", help="Few samples and steps: to see that it works.")
    ] = False,
) -> None:
    """Make the paper's table and figures again: on your data, or on a generated route."""
    begin = time.perf_counter()
    drawing()
    # Not at the top: matplotlib is an extra, and slow to import.
    from surefix.report.page import output_folder
    from surefix.reproduce import Settings, exhibits, read_pairs, read_paper, write_report
    from surefix.reproduce.report import STEPS

    settings = Settings(recall, quick)
    numbers = None if paper is None else read_paper(paper)
    pairs = read_pairs(pair or [])
    if pairs and data is None:
        raise SurefixValueError(
            "--pair: expected --data with it, the folder with the data sets, got none"
        )
    with _progress() as progress:
        task = progress.add_task("Looking for data", total=STEPS)
        show = partial(progress.update, task)
        cases, problems = _cases(data, pairs, matrix or [], similarity, settings, show)
        cases = hold(cases)
        output_folder(out)
        made = []
        show(description="Making the exhibits")
        for step, exhibit in enumerate(exhibits(cases, settings, numbers), 1):
            say(f"{step} of {STEPS}: {exhibit.title}", flush=True)
            made.append(exhibit)
            show(completed=step)
        show(description="Writing the report")
        command = shlex.join(["surefix", *sys.argv[1:]])
        report = write_report(out, made, cases, settings, problems=problems, command=command)
    for point in made[0].points:
        say(point)
    pictures = sum(len(exhibit.pictures) for exhibit in made)
    say(
        f"Made {report}, with {pictures} pictures and {len(made)} tables beside it, from "
        f"{len(cases)} cases, in {time.perf_counter() - begin:.1f} s"
    )


def _cases(
    data: Path | None,
    pairs: dict[str, list[tuple[str, str]]],
    matrices: list[str],
    similarity: bool,
    settings: "Settings",
    show: Callable[..., None],
) -> tuple[list["Case"], list[str]]:
    """The cases, and the reasons why some data could not be used; each is printed as it comes."""
    from surefix.reproduce import check_pairs, find_datasets, load_cases
    from surefix.reproduce.case import generated_cases, matrix_case

    found, problems = [], []
    if data is not None:
        found = find_datasets(data)
        try:
            check_pairs(data, found, pairs)
        except SurefixValueError as error:
            raise typer.BadParameter(str(error)) from None
        if not found:
            problems.append(
                f"{data}: no data set of the paper in it, nor a folder with reference/ and query/"
            )
    cases: list[Case] = [matrix_case(text, similarity=similarity) for text in matrices]
    for one in found:
        show(description=f"{one.title}: reading {one.folder}")
        wanted = pairs.get(one.dataset, [])
        chosen = [pair for pair in wanted if one.has(pair)]
        # Of another folder of the same data set.
        missing = ["/".join(pair) for pair in wanted if pair not in chosen]
        problems += [f"--pair {one.dataset}: no {pair} in {one.folder}" for pair in missing]
        if chosen or not wanted:
            loaded, wrong = load_cases(one, chosen)
            cases += loaded
            problems += wrong
    for problem in problems:
        say(f"Not used: {problem}", file=sys.stderr)
    if not cases:
        show(description="Driving the generated route")
        cases += generated_cases(settings)
        say("No real data: this is the generated route, a drawn world", flush=True)
    for case in cases:
        places, queries = case.D.shape
        say(f"{case.name}: {places} places, {queries} queries", flush=True)
    return cases, problems


def _progress() -> Progress:
    """A bar on a terminal, nothing in a pipe."""
    console = Console(stderr=True, force_terminal=sys.stderr.isatty())
    text = TextColumn("{task.description}", markup=False)
    columns = SpinnerColumn(), text, BarColumn(), MofNCompleteColumn()
    # Lines printed meanwhile go above the bar, unless they go elsewhere.
    above, silent = sys.stdout.isatty(), not console.is_terminal
    return Progress(
        *columns, console=console, transient=True, redirect_stdout=above, disable=silent
    )
