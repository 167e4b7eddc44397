"""``surefix eval``: methods compared on a drive whose truth is known, with a report."""

import shlex
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.text import Text

from surefix import Motion, SurefixError, SurefixValueError, match_distances
from surefix._extra import drawing
from surefix._terminal import Console, say
from surefix._words import plural
from surefix.baselines import METHODS, Context
from surefix.cli import inputs, scenarios
from surefix.cli.drives import (
    Listed,
    MapColumns,
    advance_without,
    bag_of,
    describe,
    distances_of,
    known,
    look_at,
    names_and_advances,
    networks_of,
    truth_without,
    without,
)
from surefix.cli.flags import SELDOM, TRUTH, documented, settings_of, with_options, with_ray
from surefix.cli.inputs import refuse
from surefix.cli.networks import Model, ModelOptions, Output, Weights
from surefix.cli.pages import Open, show, title_of
from surefix.cli.pictures import pictures_of, reference_images
from surefix.cli.results import print_results, warn_of_fit, warn_of_similarities
from surefix.cli.route import Route, SaveMap, is_matrix, open_route
from surefix.cli.techniques import Technique
from surefix.cli.where import (
    GAP,
    Places,
    PositionGap,
    Queries,
    by_positions,
    by_truth,
    gps_of,
)
from surefix.errors import mismatch, refusal
from surefix.frames import ImageFrames
from surefix.frames.by_name import thumbnails_of
from surefix.frames.images import Images, ShownImages, open_images
from surefix.machine import room_for
from surefix.study.scenarios import RECORDED
from surefix.study.study import Recall
from surefix.tables.columns import Columns, is_held
from surefix.tables.matrices import large_matrix, read_matrix
from surefix.tables.reports import drive_of
from surefix.tables.truth import read_truth

if TYPE_CHECKING:
    from surefix.study import Result

SUPERVISED = "Supervised methods"
DEFAULT_METHODS = ("sequence", "weighted", "single", "masked")


@with_ray
@documented
@with_options(floor="global", names={"tolerance": "agreement"})
def eval_(
    route: str,
    queries: inputs.Place | None = None,
    out: Annotated[Path, typer.Option("--out", "-o")] = Path("report"),
    method: Annotated[
        list[str] | None,
        typer.Option(
            help=f"A method to compare, once each: {', '.join(METHODS)}. "
            f"By default {', '.join(DEFAULT_METHODS)}; with --scenario "
            f"{', '.join(scenarios.METHODS_OF_DRIVES)}."
        ),
    ] = None,
    model: Model = None,
    weights: Weights = None,
    output: Output = None,
    save_map: SaveMap = None,
    cache: inputs.Cache = None,
    truth: Annotated[str | None, TRUTH] = None,
    positions: Annotated[Path | None, TRUTH] = None,
    query_positions: Annotated[str | None, TRUTH] = None,
    position_gap: PositionGap = GAP,
    tolerance: Annotated[float | None, typer.Option(min=0, rich_help_panel=TRUTH)] = None,
    recall: Annotated[Recall, SELDOM] = "correct",
    similarity: bool = False,
    references: str | None = None,
    fuse: list[str] | None = None,
    *,
    options: dict[str, Any],
    config: Annotated[Path | None, typer.Option("--config", "-c")] = None,
    calibration: Annotated[Path | None, SUPERVISED] = None,
    calibration_truth: Annotated[str | None, SUPERVISED] = None,
    calibration_tolerance: Annotated[int, typer.Option(min=0, rich_help_panel=SUPERVISED)] = 1,
    scenario: Annotated[list[str] | None, "Scenarios"] = None,
    speed_profile: Annotated[Path | None, "Scenarios"] = None,
    spacing: float | None = None,
    seed: Annotated[int, typer.Option(min=0, rich_help_panel="Scenarios")] = 0,
    odometry_scale: Annotated[float, "Scenarios"] = 0.03,
    odometry_noise: Annotated[float, typer.Option(min=0, rich_help_panel="Scenarios")] = 0.1,
    topic: inputs.Topic = None,
    stride: inputs.Stride = 1,
    every: inputs.Every = None,
    metres: inputs.Metres = None,
    odometry: inputs.Odometry = None,
    places_per_metre: Annotated[
        float | None, typer.Option(help="--odometry: places of the map in a metre, or --spacing.")
    ] = None,
    gap: float | None = None,
    order: inputs.Order = "name",
    strict: inputs.Strict = False,
    crop: inputs.Crop = False,
    spreadsheet: inputs.Spreadsheet = False,
    open_: Open = False,
) -> None:
    """Compare methods on a drive whose truth is known: curves, a table, and where it fails, in one
    report.

    Parameters
    ----------
    route: The map, from `surefix map build`; or images as QUERIES, of which one is made in memory;
        or a .npy of distances, (places, queries).
    queries: A folder of images, a pattern, a .npy of images, a video or a bag; or ready
        descriptors, as for `surefix map build`. With a .npy of distances: the images of its
        queries, if any, for the pictures.
    truth: "identity" (query i is place i); a .npy of places (m,), -1 for none, of lists of them, or
        of a matrix (n, m); a .csv with the columns query,reference, a row a query; or
        Patch-NetVLAD's .npz of positions.
    positions: In place of --truth: metres of each place, .npy or .csv; a .csv with the header
        latitude,longitude; a trajectory of TUM, KITTI or EuRoC; or a folder of images named
        @east@north@. The map's by default.
    query_positions: In place of --truth: those of each query, as for --positions; or at times of
        their own, in a column time or a topic of the queries' bag, if the queries have times. Those
        that are empty or nan are not known, and left out. By default --odometry, if that is a topic
        of NavSatFix.
    tolerance: The greatest distance from the truth of a right match: in places, 1 by default; with
        positions in metres.
    out: The folder to write; an earlier report in it is replaced.
    recall: The queries that recall is a share of.
    similarity: The .npy holds similarities s: the distances are 1 - s.
    references: The images of the places, for the pictures: a folder, a pattern, a .npy, or the
        video or bag that the map was made of; by default ROUTE's, if that is images, or the map's
        thumbnails.
    fuse: Another technique's map of the same places, or .npy of distances, once each: for the
        method fused.
    config: The options of `surefix tune`'s settings, and its motion for the method track; the
        threshold is not judged.
    calibration: Another drive's .npy of distances, for the supervised methods to learn from.
    calibration_truth: That drive's truth, as for --truth, in places.
    calibration_tolerance: As --tolerance, for that truth, in places.
    scenario: The methods on a drive made of this one too, once each: recorded, speeds, profile,
        missing, kidnap, all (speeds, missing and kidnap at once), rate-1/3, rate-1/2, rate-2,
        rate-3, rate-5; or every. Odometry is made of the truth.
    speed_profile: For the scenario profile: a .csv of speeds in m/s, a row a second.
    spacing: Metres from one place of the map to the next: for --odometry, by default by the map's
        positions; for the scenario profile, by default a query is taken once a second, and moves a
        place at the median speed.
    gap: Treat frames more than this many seconds apart as a break.
    seed: The same seed gives the same drives.
    odometry_scale: The odometry says so much more than was driven, as a share.
    odometry_noise: The deviation of a step of the odometry, as a share of it.
    """
    begin = time.perf_counter()
    if truth is None and query_positions is None:
        query_positions = gps_of(odometry, queries)
        if query_positions is not None:
            say(f"--query-positions: {query_positions}, as --odometry", file=sys.stderr)
    by_matrix, by_position = is_matrix(route), query_positions is not None
    chosen = ModelOptions(model, weights, output)
    drives = scenarios.chosen(scenario or (), speed_profile)
    usual = scenarios.METHODS_OF_DRIVES if drives else DEFAULT_METHODS
    if odometry is not None and metres is None and not drives:
        usual = (*usual, "track_odometry")
    usual = (*usual, "fused") if fuse else usual
    settings = {**options} if config is None else settings_of(config, options).options
    motion = settings.get("motion")
    settings |= {"motion": Motion(**motion) if isinstance(motion, dict) else motion}
    usual = (*usual, "track") if motion else usual
    methods, taught = method or usual, calibration is not None
    sampling: dict[str, Any] = {"topic": topic, "stride": stride, "every": every}
    sampling |= {"metres": metres, "odometry": odometry, "gap": gap}
    for name in methods:
        expected = f"--method: expected one of {', '.join(METHODS)}, got {name!r}"
        refuse(name not in METHODS, expected)
    context = Context(calibration_tolerance=calibration_tolerance, **settings)
    expected = "--similarity: expected a .npy of similarities to read, got a map, which has none"
    refuse(similarity and not by_matrix and not taught, expected)
    if queries is None:
        inputs.check_sampling("none", **sampling)
        refuse(not by_matrix, "QUERIES: expected the drive's images or descriptors, got none")
    both = truth is not None and (by_position or positions is not None)
    refuse(both, "--truth: expected it or positions, got both")
    expected = "--truth: expected identity (query i is place i), a FILE, or --query-positions"
    neither = f"{expected}; got none. Without a truth: surefix audit"
    refuse(truth is None and not by_position, neither)
    expected = "--tolerance: expected how many metres from the truth are right, got none"
    refuse(by_position and tolerance is None, expected)
    part = truth is not None and tolerance is not None and not tolerance.is_integer()
    part = part and not str(truth).lower().endswith(".npz")
    refuse(part, f"--tolerance: expected a whole number of places, got {tolerance}")
    expected = "--calibration: expected it and --calibration-truth, or neither"
    refuse(taught != (calibration_truth is not None), expected)
    for name in methods:
        expected = "expected --calibration and --calibration-truth to learn from"
        refuse(METHODS[name].needs == "calibration" and not taught, f"--method {name}: {expected}")
        scenarios.check_method(name, drives, odometry)
        expected = "expected --motion or --config"
        refuse(METHODS[name].needs == "motion" and motion is None, f"--method {name}: {expected}")
        expected = "expected --fuse with other techniques"
        refuse(METHODS[name].needs == "techniques" and not fuse, f"--method {name}: {expected}")
    # The advances of a scenario are made of its truth.
    moved = not drives and any(METHODS[name].needs == "advance" for name in methods)
    alone = places_per_metre is not None and odometry is None
    refuse(alone, "--places-per-metre: expected --odometry too")
    drawing()
    # Not at the top: matplotlib is an extra, and slow to import.
    from surefix.report.eval import write_report
    from surefix.report.figures import MISTAKES
    from surefix.study import Study, compare
    from surefix.study.streamed import compare_columns, unstreamed
    from surefix.study.study import run_methods

    # Open the map or the distances, and the queries.
    D, place_map, network = None, None, None
    known_route: Route | None = None
    columns: Columns | None = None
    reading: dict[str, Any] = {"order": order, "strict": strict}
    if by_matrix:
        named_too = model is not None or save_map is not None
        refuse(
            named_too, f"--model, --save-map: expected a map or images, got the distances {route}"
        )
        columns = large_matrix(route, similarity)
        if columns is None:
            D = read_matrix(route, similarity)
    else:
        read = [truth, positions, query_positions, config, cache, speed_profile, *(fuse or ())]
        read += [calibration, calibration_truth]
        known_route = open_route(route, chosen, save_map, read, queries, **reading, **sampling)
        place_map = known_route.map
    if moved:
        of_map = None if place_map is None else place_map.positions
        sampling["places_per_metre"], _ = inputs.scale_of(of_map, spacing, places_per_metre)
        refuse(sampling["places_per_metre"] is None, inputs.NO_SCALE)
    refuse(crop and place_map is None, "--crop: expected a map, got distances")
    shape = None if place_map is None else inputs.crop_of(place_map, crop)
    reading["crop"] = shape
    frames = None if queries is None else inputs.open_frames(queries, **reading, **sampling)
    listed = Listed([], [], [], [], 0) if frames is None else names_and_advances(frames)
    names, advance, times = listed.names, listed.advances, listed.times
    ready = D if columns is None else columns
    if ready is not None:
        places, count = ready.shape
        if isinstance(frames, ImageFrames):
            # Only images are of use beside distances.
            open_images(Path(str(queries)))
        if frames is not None and len(names) != count:
            got = f"{len(names)} images for {count} queries"
            raise mismatch(queries, f"an image for each column of {route}", got)
    else:
        assert place_map is not None
        assert frames is not None
        places, count = len(place_map), len(names)
        # Of several maps, those of learned descriptors are the model's.
        mine = chosen if not fuse or place_map.descriptor is None else ModelOptions()
        assert known_route is not None
        made_with = known_route.network
        (network,) = networks_of([place_map], [route], mine, frames, made=made_with)
    expected = "--cache: expected images for a network, as --model is"
    refuse(cache is not None and network is None, expected)

    # All distances are held if they are few, or if a method or a scenario needs them at once.
    whole = [*unstreamed(methods), *(f"--scenario {name}" for name in drives)]
    streamed = not is_held(places, count) and not whole
    if not is_held(places, count) and whole:
        size = f"{places} x {count} distances, for {whole[0]} all at once"
        room_for(3 * 4 * places * count, size)
        D, columns = read_matrix(route, similarity) if by_matrix else None, None

    # Read the truth.
    where = None if place_map is None else place_map.positions
    mapped = Places(places) if place_map is None else Places.of(place_map)
    named = [] if frames is None or frames.ready is not None else names
    recorded = () if by_matrix else (listed.numbers, listed.total)
    driven = Queries(count, named, times, bag_of(frames), *recorded)
    if truth is not None:
        judged = by_truth(truth, mapped, driven, tolerance)
    else:
        assert query_positions is not None
        assert tolerance is not None
        paths = positions, query_positions
        judged = by_positions(*paths, mapped, driven, tolerance, position_gap)
    if isinstance(judged.truth, tuple):
        where = np.asarray(judged.truth[0], np.float64)
    along = judged.along
    context = replace(context, truth=judged.truth, truth_tolerance=judged.tolerance)
    if place_map is not None:
        context = replace(context, segments=place_map.segments)
    if where is not None:
        context = replace(context, positions=where)
    if calibration is not None and calibration_truth is not None:
        learned = read_matrix(calibration, similarity)
        lesson = read_truth(calibration_truth, *learned.shape)
        context = replace(context, calibration=(learned, lesson))
    if moved:
        context = replace(context, advance=known(advance))
    others = [
        Technique.open(file, places, count, frames, chosen, similarity) for file in fuse or ()
    ]
    speeds = None if speed_profile is None else scenarios.read_speeds(speed_profile)
    levels = None if place_map is None else place_map.levels
    pictures: Any = None if known_route is None else known_route.pictures
    if references is not None:
        pictures = reference_images(references, places, place_map, topic)
    elif pictures is None and place_map is not None:
        pictures = thumbnails_of(place_map)
    if isinstance(pictures, Images):
        pictures = ShownImages(pictures, levels)
    context = replace(context, gaps=listed.breaks)
    _check_before(places, settings, out)

    # Compare the methods.
    start, given = time.perf_counter(), frames
    bad: set[int] = set()
    if D is None and columns is None:
        assert place_map is not None
        assert frames is not None
        look_at(place_map, frames, crop)
        rows = describe(place_map, frames, network, cache, None if strict else bad)
        if bad:
            # The rest of the truth is still that of the queries that are left.
            frames = without(frames, bad)
            names = [name for index, name in enumerate(names) if index not in bad]
            count, along = len(names), None if along is None else np.delete(along, [*bad])
            left = [query - sum(each < query for each in bad) for query in context.gaps]
            context = replace(context, truth=truth_without(context.truth, bad), gaps=left)
            if context.advance is not None:
                context = replace(context, advance=advance_without(context.advance, bad))
        if streamed:
            columns = MapColumns(place_map, rows)
        else:
            D = distances_of(place_map, rows)
    elif not similarity:
        some = D if columns is None else columns.block(0, min(columns.width, count))
        assert some is not None
        warn_of_similarities(some, context)
    # Now, as some of the frames are read once more for their pictures.
    notes = [] if given is None else inputs.notes_on(given, names)
    if others:
        techniques = [other.distances(frames, bad) for other in others]
        context = replace(context, techniques=techniques)
    size = f"{plural(places, 'place')} x {plural(count, 'query', 'queries')}"
    how_long = "as they are needed" if streamed else f"in {time.perf_counter() - start:.1f} s"
    say(f"Distances: {size}, {how_long}")
    console = Console(stderr=True, force_terminal=sys.stderr.isatty())
    with console.status("Comparing the methods") as status:

        def done(result: "Result") -> None:
            # Of a string, Rich would read markup.
            status.update(Text(f"Comparing the methods: {result.name} done"))

        how: dict[str, Any] = {"profile": speeds, "spacing": spacing}
        how |= {"scale_error": odometry_scale, "noise": odometry_noise}
        if drives:
            assert D is not None
            context = Study(D, context).driven(RECORDED, seed, **how).context
        if columns is not None:
            study: Study = compare_columns(columns, methods, context, recall, done)
        else:
            assert D is not None
            study = compare(D, methods, context, recall, done)
        made = []
        for name in drives:
            if name != RECORDED:
                status.update(f"Comparing the methods: {name}")
                made.append(run_methods(study.driven(name, seed, **how)))
    print_results(study)
    if not judged.by_position:
        warn_of_fit(study)
    if drives:
        scenarios.print_drives([study, *made])

    # Draw the report.
    place_names = None if place_map is None else place_map.names
    try:
        with console.status("Drawing the report"):
            mistakes = {*study.mistakes(MISTAKES), *study.trusted_mistakes(MISTAKES)}
            images, album = (
                pictures_of(frames, mistakes, levels) if frames is not None else (None, None)
            )
            report = write_report(
                study,
                out,
                shlex.join(["surefix", *sys.argv[1:]]),
                title=title_of(queries, route),
                queries=images,
                album=album,
                references=pictures,
                query_names=None if frames is None or frames.ready is not None else names,
                place_names=pictures.names if isinstance(pictures, Images) else place_names,
                along=along,
                scenarios=made,
                drive=drive_of(given.files) if given is not None and given.ready is None else None,
                spreadsheet=spreadsheet,
            )
    except SurefixError:
        raise
    except OSError as error:
        raise refusal(out, "cannot write the report", error) from None
    say(
        f"Made {report}: {plural(len(study.results), 'method')} compared, with pictures and tables "
        f"beside it, in {time.perf_counter() - begin:.1f} s"
        + "".join(f"; {note}" for note in notes)
    )
    show(report, open_)


def _check_before(places: int, options: dict[str, Any], out: Path) -> None:
    """The matcher's own checks, and the output folder, before the slow part."""
    try:
        match_distances(np.zeros((places, 1), np.float32), **options | {"technique_weights": []})
    except SurefixValueError as error:
        raise typer.BadParameter(str(error)) from None
    # Not at the top: matplotlib is an extra, and slow to import.
    from surefix.report.page import output_folder

    output_folder(out)
