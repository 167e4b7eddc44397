"""``surefix eval``: methods compared on a drive whose truth is known, with a report."""

import shlex
import sys
import time
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import numpy.typing as npt
import typer
from rich.console import Console

from surefix import SurefixError, SurefixFileError, SurefixValueError, match_distances
from surefix._words import counted
from surefix.baselines import METHODS, Context
from surefix.baselines.truth import Truth, right_matches
from surefix.cli.drives import Drives, open_drives, read_matrix, reference_images
from surefix.cli.flags import with_options
from surefix.cli.positions import Positions, on_one_plane, read_either
from surefix.cli.taking import Every, Metres, Odometry, Stride, Taking, Topic
from surefix.cli.truth import read_truth, truth_by_position

if TYPE_CHECKING:
    from surefix.report.comparison import Comparison, Result

__all__ = ["eval_"]

DEFAULT_METHODS = ("sequence", "weighted", "single", "masked")


class Recall(StrEnum):
    """What recall is a share of."""

    correct = "correct"
    place_exists = "place_exists"
    rejected = "rejected"


def _methods(names: list[str] | None) -> list[str]:
    for name in names or ():
        if name not in METHODS:
            raise typer.BadParameter(
                f"--method: expected one of {', '.join(METHODS)}, got {name!r}"
            )
    return list(names or DEFAULT_METHODS)


@with_options(floor="global", names={"tolerance": "agreement"})
def eval_(
    route: Annotated[
        str,
        typer.Argument(
            help="The map, from `surefix map build`; or a .npy of distances, (places, queries)."
        ),
    ],
    queries: Annotated[
        str | None,
        typer.Argument(
            help="A folder of images, a pattern, a .npy of images, a video or a bag; or ready descriptors, as for "
            "`surefix map build`. With a .npy of distances: the images of its queries, if any, for the pictures."
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(help="The ONNX file that the map was made with: describe the images by it."),
    ] = None,
    cache: Annotated[
        Path | None,
        typer.Option(
            help="--model: keep what is described here, and go on there after an interruption."
        ),
    ] = None,
    truth: Annotated[
        str | None,
        typer.Option(
            help='"identity" (query i is place i); a .npy of places (m,), -1 for none, or of a matrix (n, m); or a '
            ".csv with the columns query,reference, a row a query."
        ),
    ] = None,
    positions: Annotated[
        Path | None,
        typer.Option(
            help="In place of --truth: metres of each place, .npy or .csv; or a .csv with the header "
            "latitude,longitude. The map's by default."
        ),
    ] = None,
    query_positions: Annotated[
        Path | None,
        typer.Option(help="In place of --truth: those of each query, as for --positions."),
    ] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(
            min=0,
            help="How far from the truth is right: places, 1 by default; or metres, with positions.",
        ),
    ] = None,
    method: Annotated[
        list[str] | None,
        typer.Option(
            help=f"What to compare, once each: {', '.join(METHODS)}. By default {', '.join(DEFAULT_METHODS)}."
        ),
    ] = None,
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", help="The folder to write; an earlier report in it is replaced."
        ),
    ] = Path("report"),
    recall: Annotated[Recall, typer.Option(help="What recall is a share of.")] = Recall.correct,
    similarity: Annotated[
        bool,
        typer.Option(
            "--similarity", help="The .npy holds similarities s: the distances are 1 - s."
        ),
    ] = False,
    references: Annotated[
        str | None,
        typer.Option(
            help="The images of the places, a folder, a pattern or a .npy, for the pictures."
        ),
    ] = None,
    *,
    options: dict[str, Any],
    calibration: Annotated[
        Path | None,
        typer.Option(
            help="Another drive's .npy of distances, for the supervised methods to learn from."
        ),
    ] = None,
    calibration_truth: Annotated[
        str | None, typer.Option(help="That drive's truth, as for --truth, in places.")
    ] = None,
    calibration_tolerance: Annotated[
        int, typer.Option(min=0, help="How far from that truth is right, in places.")
    ] = 1,
    topic: Topic = None,
    stride: Stride = 1,
    every: Every = None,
    metres: Metres = None,
    odometry: Odometry = None,
) -> None:
    """Compare methods on a drive whose truth is known: curves, a table, and where it fails, in one
    report.
    """
    begin = time.perf_counter()
    names = _methods(method)
    context = Context(calibration_tolerance=calibration_tolerance, **options)
    if similarity and Path(route).suffix != ".npy" and calibration is None:
        raise typer.BadParameter(
            "--similarity: expected a .npy of similarities to read, got a map, which has none"
        )
    if cache is not None and model is None:
        raise typer.BadParameter("--cache: expected --model too, got none")
    taking = Taking(topic, stride, every, metres, odometry)
    if queries is None:
        taking.check_none("none")
    _check_usage(
        route,
        queries,
        truth,
        positions,
        query_positions,
        tolerance,
        calibration,
        calibration_truth,
        names,
    )
    try:
        # Not at the top: matplotlib is an extra, and slow to import.
        from surefix.report.comparison import compare
        from surefix.report.comparison_pictures import MISTAKES
        from surefix.report.comparison_report import write_comparison
    except ModuleNotFoundError as error:
        raise SurefixError(str(error)) from None
    drives = open_drives(route, queries, similarity, taking, model, cache)
    known = _truth(drives, truth, positions, query_positions)
    context = replace(context, truth=known, truth_tolerance=_tolerance(tolerance, known))
    where = known[0] if isinstance(known, tuple) else drives.positions
    if where is not None:
        context = replace(context, positions=where)
    if calibration is not None:
        learned = read_matrix(calibration, similarity)
        assert calibration_truth is not None
        context = replace(
            context, calibration=(learned, read_truth(calibration_truth, *learned.shape))
        )
    pictures = None if references is None else reference_images(references, drives.places)
    _check_options(drives.places, options)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SurefixFileError(
            f"{out}: cannot make the output folder: {error.strerror or error}"
        ) from None

    start = time.perf_counter()
    D = drives.distances()
    size = f"{counted(drives.places, 'place')} x {counted(drives.queries, 'query', 'queries')}"
    print(f"Distances: {size}, in {time.perf_counter() - start:.1f} s")
    if drives.matrix is not None and not similarity:
        _warn_of_similarities(D, context)
    console = Console(stderr=True, force_terminal=sys.stderr.isatty())
    with console.status("Comparing the methods") as status:
        comparison = compare(
            D,
            names,
            context,
            recall.value,
            lambda result: status.update(f"Comparing the methods: {result.name} done"),
        )
    for result in comparison.results:
        print(_account(result))
    print(_trust(comparison))
    _warn_of_none_judged(comparison)
    along = None
    if isinstance(known, tuple):
        steps = np.linalg.norm(np.diff(np.asarray(known[1]), axis=0), axis=1)
        along = np.concatenate(([0.0], np.cumsum(steps)))
    try:
        with console.status("Drawing the report"):
            mistakes = {*comparison.mistakes(MISTAKES), *comparison.trusted_mistakes(MISTAKES)}
            report = write_comparison(
                comparison,
                out,
                shlex.join(["surefix", *sys.argv[1:]]),
                queries=drives.pictures(mistakes),
                references=pictures,
                query_names=drives.names,
                place_names=drives.place_names if pictures is None else pictures.names,
                along=along,
            )
    except SurefixError:
        raise
    except OSError as error:
        raise SurefixFileError(
            f"{out}: cannot write the report: {error.strerror or error}"
        ) from None
    count = len(comparison.results)
    seconds = time.perf_counter() - begin
    print(
        f"Made {report}: {count} method{'' if count == 1 else 's'} compared, "
        f"with pictures and tables beside it, in {seconds:.1f} s"
    )


def _check_usage(
    route: str,
    queries: str | None,
    truth: str | None,
    positions: Path | None,
    query_positions: Path | None,
    tolerance: float | None,
    calibration: Path | None,
    calibration_truth: str | None,
    names: list[str],
) -> None:
    """What can be said against the options before anything is read."""
    if queries is None and Path(route).suffix != ".npy":
        raise typer.BadParameter("QUERIES: expected the drive's images or descriptors, got none")
    if truth is not None and (positions is not None or query_positions is not None):
        raise typer.BadParameter("--truth: expected it or positions, got both")
    if truth is None and query_positions is None:
        raise typer.BadParameter("--truth: expected it, or --query-positions; got neither")
    if query_positions is not None and tolerance is None:
        raise typer.BadParameter(
            "--tolerance: expected how many metres from the truth are right, got none"
        )
    if truth is not None and tolerance is not None and not tolerance.is_integer():
        raise typer.BadParameter(
            f"--tolerance: expected a whole number of places, got {tolerance:g}"
        )
    if (calibration is None) != (calibration_truth is None):
        raise typer.BadParameter("--calibration: expected it and --calibration-truth, or neither")
    needing = [name for name in names if METHODS[name].needs == "calibration"]
    if needing and calibration is None:
        raise typer.BadParameter(
            f"--method {needing[0]}: expected --calibration and --calibration-truth to learn from"
        )


def _check_options(places: int, options: dict[str, Any]) -> None:
    """Runs the matcher's own checks before the slow part."""
    try:
        match_distances(np.zeros((places, 1), np.float32), **options)
    except SurefixValueError as error:
        raise typer.BadParameter(str(error)) from None


def _truth(
    drives: Drives, truth: str | None, positions: Path | None, query_positions: Path | None
) -> Truth:
    if truth is not None:
        return read_truth(truth, drives.places, drives.queries)
    assert query_positions is not None
    if positions is not None:
        there = read_either(positions)
    elif drives.positions is not None:
        there = Positions("the map", drives.positions)
    else:
        raise typer.BadParameter("--positions: expected those of the places, as the map has none")
    return truth_by_position(
        *on_one_plane(there, read_either(query_positions)), drives.places, drives.queries
    )


def _tolerance(given: float | None, truth: Truth) -> float:
    if isinstance(truth, tuple):
        assert given is not None
        return given
    return 1 if given is None else int(given)


def _account(result: "Result") -> str:
    area, low, high = result.area
    right = f"{result.curve.correct} of {result.curve.judged} right"
    return f"{result.name}: area up to recall 0.2 is {area:.3f} ({low:.3f} to {high:.3f}), {right}"


def _trust(comparison: "Comparison") -> str:
    t = comparison.trust
    trusted = t.true_positives + t.false_positives
    return (
        f"Trusted single matches: {t.true_positives} of {trusted} right, {t.false_positives} wrong"
    )


def _warn_of_similarities(D: npt.NDArray[np.float32], context: Context) -> None:
    """A line where the places of greatest distance are the right ones."""
    assert context.truth is not None
    near, far = (
        int(right_matches(best(D, axis=0), len(D), context.truth, context.truth_tolerance)[0].sum())
        for best in (np.argmin, np.argmax)
    )
    if far > 2 * near and far >= near + 5:
        print(
            f"Warning: of the places at the greatest distance {far} are right, of the nearest {near}: "
            "are these similarities? Then use --similarity",
            file=sys.stderr,
        )


def _warn_of_none_judged(comparison: "Comparison") -> None:
    """A line where no query of a method could be held against the truth."""
    names = [result.name for result in comparison.results if not result.judged.any()]
    if not names:
        return
    length, queries = comparison.context.sequence_length, len(comparison)
    if length > queries:
        why = f"a sequence takes {length} queries, and the drive has {queries}"
    else:
        why = "the truth says nothing about any match"
    print(f"Warning: no query was judged for {', '.join(names)}: {why}", file=sys.stderr)
