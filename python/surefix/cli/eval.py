"""``surefix eval``: methods compared on a drive whose truth is known, with a report."""

import shlex
import sys
import time
from collections.abc import Collection, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from enum import StrEnum
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import numpy as np
import numpy.typing as npt
import typer
from rich.console import Console

from surefix import (
    Localizer,
    Map,
    SurefixError,
    SurefixValueError,
    match_distances,
)
from surefix._progress import terminal_bar
from surefix._words import plural
from surefix.baselines import METHODS, Context
from surefix.baselines.truth import Truth, right_matches
from surefix.cli.flags import documented, with_options
from surefix.cli.inputs import (
    Cache,
    Every,
    Metres,
    Model,
    Odometry,
    Stride,
    Topic,
    check_sampling,
    network_of,
    no_model,
    open_frames,
    refuse,
)
from surefix.descriptors import Onnx, extract
from surefix.descriptors.mapping import sad_map
from surefix.errors import mismatch, refusal
from surefix.frames import Frames, ImageFrames
from surefix.frames.images import Images, open_images
from surefix.frames.opening import is_recording
from surefix.tables.matrices import read_matrix
from surefix.tables.positions import Positions, on_one_plane, read_positions
from surefix.tables.truth import read_truth

if TYPE_CHECKING:
    from surefix.study import Result, Study

Image: TypeAlias = npt.NDArray[np.uint8]
Pictures: TypeAlias = Sequence[Image] | Mapping[int, Image]

DEFAULT_METHODS = ("sequence", "weighted", "single", "masked")


class Recall(StrEnum):
    """The queries that recall is a share of."""

    correct = "correct"
    place_exists = "place_exists"
    rejected = "rejected"


def _methods(names: list[str] | None) -> list[str]:
    for name in names or ():
        expected = f"one of {', '.join(METHODS)}"
        refuse(name not in METHODS, f"--method: expected {expected}, got {name!r}")
    return list(names or DEFAULT_METHODS)


@documented
@with_options(floor="global", names={"tolerance": "agreement"})
def eval_(
    route: str,
    queries: Annotated[str | None, typer.Argument()] = None,
    model: Model = None,
    cache: Cache = None,
    truth: str | None = None,
    positions: Path | None = None,
    query_positions: Path | None = None,
    tolerance: Annotated[float | None, typer.Option(min=0)] = None,
    method: Annotated[
        list[str] | None,
        typer.Option(
            help=f"A method to compare, once each: {', '.join(METHODS)}. "
            f"By default {', '.join(DEFAULT_METHODS)}."
        ),
    ] = None,
    out: Annotated[Path, typer.Option("--out", "-o")] = Path("report"),
    recall: Recall = Recall.correct,
    similarity: bool = False,
    references: str | None = None,
    *,
    options: dict[str, Any],
    calibration: Path | None = None,
    calibration_truth: str | None = None,
    calibration_tolerance: Annotated[int, typer.Option(min=0)] = 1,
    topic: Topic = None,
    stride: Stride = 1,
    every: Every = None,
    metres: Metres = None,
    odometry: Odometry = None,
) -> None:
    """Compare methods on a drive whose truth is known: curves, a table, and where it fails, in one
    report.

    Parameters
    ----------
    route: The map, from `surefix map build`; or a .npy of distances, (places, queries).
    queries: A folder of images, a pattern, a .npy of images, a video or a bag; or ready
        descriptors, as for `surefix map build`. With a .npy of distances: the images of its
        queries, if any, for the pictures.
    truth: "identity" (query i is place i); a .npy of places (m,), -1 for none, or of a matrix (n,
        m); or a .csv with the columns query,reference, a row a query.
    positions: In place of --truth: metres of each place, .npy or .csv; or a .csv with the header
        latitude,longitude. The map's by default.
    query_positions: In place of --truth: those of each query, as for --positions.
    tolerance: The greatest distance from the truth of a right match: in places, 1 by default; with
        positions in metres.
    out: The folder to write; an earlier report in it is replaced.
    recall: The queries that recall is a share of.
    similarity: The .npy holds similarities s: the distances are 1 - s.
    references: The images of the places, a folder, a pattern or a .npy, for the pictures.
    calibration: Another drive's .npy of distances, for the supervised methods to learn from.
    calibration_truth: That drive's truth, as for --truth, in places.
    calibration_tolerance: As --tolerance, for that truth, in places.
    """
    begin = time.perf_counter()
    methods = _methods(method)
    context = Context(calibration_tolerance=calibration_tolerance, **options)
    is_matrix, calibrated = Path(route).suffix == ".npy", calibration is not None
    refuse(
        similarity and not is_matrix and not calibrated,
        "--similarity: expected a .npy of similarities to read, got a map, which has none",
    )
    refuse(cache is not None and model is None, "--cache: expected --model too, got none")
    sampling: dict[str, Any] = {"topic": topic, "stride": stride, "every": every}
    sampling |= {"metres": metres, "odometry": odometry}
    if queries is None:
        check_sampling("none", **sampling)
        refuse(not is_matrix, "QUERIES: expected the drive's images or descriptors, got none")
    by_position = positions is not None or query_positions is not None
    refuse(truth is not None and by_position, "--truth: expected it or positions, got both")
    refuse(
        truth is None and query_positions is None,
        "--truth: expected it, or --query-positions; got neither",
    )
    refuse(
        query_positions is not None and tolerance is None,
        "--tolerance: expected how many metres from the truth are right, got none",
    )
    refuse(
        truth is not None and tolerance is not None and not tolerance.is_integer(),
        f"--tolerance: expected a whole number of places, got {tolerance}",
    )
    refuse(
        calibrated != (calibration_truth is not None),
        "--calibration: expected it and --calibration-truth, or neither",
    )
    for name in methods:
        refuse(
            METHODS[name].needs == "calibration" and not calibrated,
            f"--method {name}: expected --calibration and --calibration-truth to learn from",
        )
    try:
        # Not at the top: matplotlib is an extra, and slow to import.
        from surefix.report.eval import write_report
        from surefix.report.figures import MISTAKES
        from surefix.study import compare
    except ModuleNotFoundError as error:
        raise SurefixError(str(error)) from None
    D, place_map, network = None, None, None
    if is_matrix:
        expected = "--model: expected a map made with one"
        refuse(model is not None, f"{expected}, got the distances {route}")
        D = read_matrix(route, similarity)
    else:
        place_map = _open_map(route)
        network = None if model is None else network_of(place_map, route, model)
    frames = None if queries is None else open_frames(queries, **sampling)
    names = None if frames is None else _names(frames)
    if D is not None:
        places, count = D.shape
        if isinstance(frames, ImageFrames):
            # Only images are of use beside distances.
            open_images(Path(str(queries)))
        if names is not None and len(names) != count:
            raise SurefixValueError(
                f"{queries}: expected an image for each column of {route}, "
                f"got {len(names)} images for {count} queries"
            )
    else:
        assert place_map is not None
        assert frames is not None
        assert names is not None
        places, count = len(place_map), len(names)
        _check_kind(place_map, route, frames, str(queries), network)
    positions_there = None if place_map is None else place_map.positions
    known = _truth(places, count, positions_there, truth, positions, query_positions)
    context = replace(context, truth=known, truth_tolerance=_tolerance(tolerance, known))
    where = known[0] if isinstance(known, tuple) else positions_there
    if where is not None:
        context = replace(context, positions=where)
    if calibration is not None:
        learned = read_matrix(calibration, similarity)
        assert calibration_truth is not None
        context = replace(
            context, calibration=(learned, read_truth(calibration_truth, *learned.shape))
        )
    pictures = None if references is None else _reference_images(references, places)
    _check_options(places, options)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise refusal(out, "cannot make the output folder", error) from None

    start = time.perf_counter()
    if D is None:
        assert place_map is not None
        assert frames is not None
        D = _distances(place_map, frames, count, network, cache)
    elif not similarity:
        _warn_of_similarities(D, context)
    size = f"{plural(places, 'place')} x {plural(count, 'query', 'queries')}"
    print(f"Distances: {size}, in {time.perf_counter() - start:.1f} s")
    console = Console(stderr=True, force_terminal=sys.stderr.isatty())
    with console.status("Comparing the methods") as status:
        comparison = compare(
            D,
            methods,
            context,
            recall.value,
            lambda result: status.update(f"Comparing the methods: {result.name} done"),
        )
    for result in comparison.results:
        print(_account(result))
    print(_trust(comparison))
    _warn_of_none_judged(comparison)
    place_names = None if place_map is None else place_map.names
    along = None
    if isinstance(known, tuple):
        steps = np.linalg.norm(np.diff(np.asarray(known[1]), axis=0), axis=1)
        along = np.concatenate(([0.0], np.cumsum(steps)))
    try:
        with console.status("Drawing the report"):
            mistakes = {*comparison.mistakes(MISTAKES), *comparison.trusted_mistakes(MISTAKES)}
            report = write_report(
                comparison,
                out,
                shlex.join(["surefix", *sys.argv[1:]]),
                queries=None if frames is None else _pictures(frames, mistakes),
                references=pictures,
                query_names=None if frames is None or frames.ready is not None else names,
                place_names=place_names if pictures is None else pictures.names,
                along=along,
            )
    except SurefixError:
        raise
    except OSError as error:
        raise refusal(out, "cannot write the report", error) from None
    seconds = time.perf_counter() - begin
    print(
        f"Made {report}: {plural(len(comparison.results), 'method')} compared, "
        f"with pictures and tables beside it, in {seconds:.1f} s"
    )


def _open_map(route: str) -> Map:
    if Path(route).is_dir():
        raise mismatch(
            route, "a map or a matrix", f"a folder; make a map of it: surefix map build {route}"
        )
    return Map.open(route)


def _check_kind(
    place_map: Map, route: str, frames: Frames, queries: str, network: Onnx | None
) -> None:
    """Refuses queries that the map cannot take."""
    if frames.ready is not None:
        got = f"got the ready descriptors {queries}"
        refuse(network is not None, f"--model: expected images, {got}")
    elif network is None and place_map.descriptor is None:
        name = None if place_map.recipe is None else str(place_map.recipe.get("name"))
        if name is not None and name.startswith("onnx:"):
            raise no_model(name, route)
        holds = f"is by {name!r}, which is no ONNX file"
        raise SurefixValueError(
            "QUERIES: expected descriptors, a .npy (m, dim), as this map "
            f"{'holds ready descriptors' if name is None else holds}; got images"
        )


def _names(frames: Frames) -> list[str]:
    """The name of each frame; a recording is read for them."""
    if isinstance(frames, ImageFrames):
        return frames.images.names
    names: list[str] = []
    bar = terminal_bar("Counting")
    with closing(frames.shots()) as shots:
        for shot in shots:
            names.append(shot.name)
            if bar is not None:
                bar(len(names), max(frames.estimate or 0, len(names) + 1))
    if bar is not None:
        bar(len(names), len(names))
    if not names:
        raise mismatch(frames.files[0], "frames", "none")
    return names


def _pictures(frames: Frames, wanted: Collection[int]) -> Pictures | None:
    """The images of these frames at least; None if there are none. A recording is read once more,
    up to the last of them.
    """
    if isinstance(frames, ImageFrames):
        return None if frames.ready is not None else frames.images
    with closing(frames.shots()) as shots:
        until = islice(shots, max(wanted, default=-1) + 1)
        return {index: shot.read() for index, shot in enumerate(until) if index in wanted}


def _distances(
    place_map: Map, frames: Frames, count: int, network: Onnx | None, cache: Path | None
) -> npt.NDArray[np.float32]:
    """Between each place and each query, shape (n, m)."""
    if frames.ready is not None:
        described = frames.ready
    elif network is not None:
        described = extract(frames, network, cache=cache)
    else:
        assert place_map.descriptor is not None
        described = sad_map(frames, place_map.descriptor).descriptors
    D = np.empty((len(place_map), count), np.float32, order="F")
    # With running statistics a query's distances depend on those before: a localizer keeps them.
    post = () if place_map.post is None else place_map.post.steps
    running = any(step["step"] == "standardize_running" for step in post)
    localizer = Localizer(place_map, sequence_length=1) if running else None
    bar = terminal_bar("Comparing")
    for query, descriptor in enumerate(described):
        if localizer is None:
            D[:, query] = place_map.distances(descriptor)
        else:
            localizer.push(descriptor)
            D[:, query] = localizer.distances
        if bar is not None:
            bar(query + 1, count)
    return D


def _reference_images(place: str, places: int) -> Images:
    if is_recording(place):
        raise SurefixValueError(
            "--references: expected a folder of images, a pattern or a .npy, got the recording "
            f"{place}; write its frames into a folder"
        )
    images = open_images(Path(place))
    if len(images) != places:
        raise mismatch(
            f"--references {place}", f"an image for each of {places} places", len(images)
        )
    return images


def _check_options(places: int, options: dict[str, Any]) -> None:
    """Runs the matcher's own checks before the slow part."""
    try:
        match_distances(np.zeros((places, 1), np.float32), **options)
    except SurefixValueError as error:
        raise typer.BadParameter(str(error)) from None


def _truth(
    places: int,
    queries: int,
    map_positions: npt.NDArray[np.float64] | None,
    truth: str | None,
    positions: Path | None,
    query_positions: Path | None,
) -> Truth:
    if truth is not None:
        return read_truth(truth, places, queries)
    assert query_positions is not None
    if positions is not None:
        there = read_positions(positions)
    elif map_positions is not None:
        there = Positions("the map", map_positions)
    else:
        raise typer.BadParameter("--positions: expected those of the places, as the map has none")
    both = on_one_plane(there, read_positions(query_positions))
    _check_positions("--positions", both[0], places)
    _check_positions("--query-positions", both[1], queries)
    if both[0].shape[1] != both[1].shape[1]:
        raise SurefixValueError(
            "--query-positions: expected the coordinates of --positions, got "
            f"{both[0].shape[1]} of places and {both[1].shape[1]} of queries"
        )
    return both


def _check_positions(option: str, array: npt.NDArray[np.float64], count: int) -> None:
    if array.ndim != 2 or array.shape[1] not in (2, 3) or len(array) != count:
        raise mismatch(option, f"{count} rows of 2 or 3 metres", f"the shape {array.shape}")
    if not np.isfinite(array).all():
        row = int(np.argmin(np.isfinite(array).all(axis=1)))
        raise mismatch(option, "finite metres", f"{array[row].tolist()} in row {row}")


def _tolerance(given: float | None, truth: Truth) -> float:
    if isinstance(truth, tuple):
        assert given is not None
        return given
    return 1 if given is None else int(given)


def _account(result: "Result") -> str:
    area, low, high = result.area
    right = f"{result.curve.correct} of {result.curve.judged} right"
    return f"{result.name}: area up to recall 0.2 is {area:.3f} ({low:.3f} to {high:.3f}), {right}"


def _trust(comparison: "Study") -> str:
    t = comparison.trust
    trusted = t.true_positives + t.false_positives
    return (
        f"Trusted single matches: {t.true_positives} of {trusted} right, {t.false_positives} wrong"
    )


def _warn_of_similarities(D: npt.NDArray[np.float32], context: Context) -> None:
    """Says so if the places of greatest distance are the right ones."""
    assert context.truth is not None
    near, far = (
        int(right_matches(best(D, axis=0), len(D), context.truth, context.truth_tolerance)[0].sum())
        for best in (np.argmin, np.argmax)
    )
    if far > 2 * near and far >= near + 5:
        print(
            f"Warning: of the places at the greatest distance {far} are right, of the nearest "
            f"{near}: are these similarities? Then use --similarity",
            file=sys.stderr,
        )


def _warn_of_none_judged(comparison: "Study") -> None:
    """Says so if no query of a method could be judged by the truth."""
    names = [result.name for result in comparison.results if not result.judged.any()]
    if not names:
        return
    length, queries = comparison.context.sequence_length, len(comparison)
    if length > queries:
        why = f"a sequence takes {length} queries, and the drive has {queries}"
    else:
        why = "the truth says nothing about any match"
    print(f"Warning: no query was judged for {', '.join(names)}: {why}", file=sys.stderr)
