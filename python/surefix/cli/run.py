"""``surefix run``: localize along a route, frame by frame, as a robot would."""

import sys
import time
from collections.abc import Sequence
from contextlib import AbstractContextManager, ExitStack, closing, nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import typer

from surefix import Localizer, Map, SurefixValueError, frames
from surefix._saving import words_on_kept
from surefix._terminal import fitted, say
from surefix._words import plural
from surefix.cli.drives import networks_of, others_of
from surefix.cli.fixes import ALARM, Summary, row_of
from surefix.cli.flags import SELDOM, documented, settings_of, with_options
from surefix.cli.inputs import (
    NO_SCALE,
    Place,
    Spreadsheet,
    check_apart,
    check_not_read,
    crop_of,
    listed,
    naming_folders,
    notes_on,
    refuse,
    scale_of,
)
from surefix.cli.networks import Model, ModelOptions, Output, Weights
from surefix.cli.pages import Open, RunPage, check_page, page_of, show, title_of
from surefix.cli.route import SaveMap, open_route
from surefix.cli.views import leave_room, open_views
from surefix.errors import check_folder
from surefix.frames import Advances, Frame, Frames, ImageFrames, in_8_bits
from surefix.frames.advances import time_in
from surefix.frames.levels import Clipping
from surefix.frames.sampling import Derived
from surefix.frames.shape import other_shape
from surefix.live import View
from surefix.tables.fix_files import Format, Writer, check_form, created, form_of, open_writer
from surefix.tables.utm import map_degrees

# The headings in the help, of the options about frames and about seeing them.
F = "Frames"
S = "Seeing it"


BOTH = "--accept: expected none beside a --config that has a threshold"
Order = Literal["name", "decimals", "whole", "time", "exif"]
Size = tuple[int, ...]


@documented
@with_options(motion="any", names={"tolerance": "agreement"})
def run(
    route: str,
    queries: Place,
    out: Annotated[Path | None, typer.Option("--out", "-o")] = None,
    form: Annotated[Format | None, typer.Option("--format")] = None,
    spreadsheet: Spreadsheet = False,
    *,
    options: dict[str, Any],
    config: Annotated[Path | None, typer.Option("--config", "-c")] = None,
    accept: float | None = None,
    fuse: list[Path] | None = None,
    screen: Annotated[Literal["i8"] | None, SELDOM] = None,
    model: Model = None,
    weights: Weights = None,
    output: Output = None,
    save_map: SaveMap = None,
    follow: Annotated[bool, F] = False,
    idle: Annotated[float | None, typer.Option(min=0, rich_help_panel=F)] = None,
    topic: Annotated[str | None, F] = None,
    stride: Annotated[int, typer.Option(min=1, rich_help_panel=F)] = 1,
    every: Annotated[float | None, F] = None,
    metres: Annotated[float | None, F] = None,
    odometry: Annotated[str | None, F] = None,
    spacing: Annotated[float | None, F] = None,
    places_per_metre: Annotated[float | None, F] = None,
    gap: Annotated[float | None, F] = None,
    newest: Annotated[bool | None, SELDOM] = None,
    order: Annotated[Order, typer.Option(rich_help_panel=F)] = "name",
    strict: Annotated[bool, F] = False,
    crop: Annotated[bool, F] = False,
    live: Annotated[bool, S] = False,
    save: Annotated[Path | None, S] = None,
    references: Annotated[str | None, S] = None,
    report: Annotated[Path | None, S] = None,
    open_: Open = False,
) -> None:
    """Localize along a route: a fix for each query, as it comes.

    Parameters
    ----------
    route: The map, from `surefix map build`; or images as QUERIES, of which one is made in memory.
    queries: A folder of images, a pattern, a video, a ROS bag or MCAP file, a camera's number or
        URL, or a .npy of images or of descriptors.
    out: Write the fixes to this file.
    form: CSV or JSON, a line for each fix; GeoJSON, a point for each; the trajectories of TUM or
        KITTI, with the route's heading; or poses as MCAP, to be played beside a bag. By the file's
        ending, else CSV.
    config: The settings of this route, as `surefix tune` writes them: options, which flags cannot
        change beside a threshold, and the threshold of accepted fixes, with an alarm.
    accept: Mark a fix as accepted if its confidence is at least this, such as 0.95.
    fuse: Another technique's map of the same places, once each: their evidence is fused.
    screen: With --motion none: scan a copy of float32 descriptors in bytes: faster on a large map,
        the same answers.
    follow: A folder: go on with what comes, until Ctrl-C.
    idle: With --follow: end when none has come for this many seconds.
    topic: A bag: the topic of the images, if there are several.
    stride: Take every n-th frame.
    every: Take a frame every this many seconds.
    metres: Take a frame every this many metres, by --odometry.
    odometry: How far the robot moves: a .csv with the columns time and x,y[,z] or distance; a
        trajectory of TUM, KITTI or EuRoC; or a topic of the bag: of odometry, poses, transforms or
        GPS fixes.
    spacing: With --odometry: the metres from one place of the map to the next; by default by the
        map's positions.
    places_per_metre: The same the other way round; below 0 if the robot's forward is the route's
        backward.
    gap: Treat frames more than this many seconds apart as a break.
    newest: If matching is slow, drop frames and take the newest; the default of a camera.
    order: The order of a folder's images: by their names (numbers with a point: decimals or whole
        say how to read the digits after it), by the time of the files' last change, or by the time
        at which the camera took them (EXIF).
    strict: Stop at a frame that cannot be read, instead of passing over it.
    crop: Cut frames of another shape than the map's images around their centre to that.
    live: Open rerun's viewer; without rerun, the terminal's.
    save: Write a recording, to be opened by rerun FILE.rrd.
    references: The map's images, to be shown beside the queries in place of its thumbnails: a
        folder, a .npy, or the video or bag that the map was made of.
    report: Write an interactive page, PAGE.html: each query beside its match, the distances, trust
        and confidence.
    """
    above_0 = {"--every": every, "--metres": metres, "--gap": gap, "--spacing": spacing}
    for option, value in above_0.items():
        low = value is not None and not value > 0
        refuse(low, f"{option}: expected a number above 0, got {value}")
    by = {"--metres": metres, "--spacing": spacing, "--places-per-metre": places_per_metre}
    for option, value in by.items():
        refuse(value is not None and odometry is None, f"{option}: expected --odometry too")
    settings = settings_of(config, options)
    motion = settings.options["motion"]
    refuse(accept is not None and settings.threshold is not None, BOTH)
    if accept is not None:
        refuse(motion is None, "--accept: expected --motion other than none")
        out_of_range = f"--accept: expected a confidence from 0 to 1, got {accept:g}"
        refuse(not 0 <= accept <= 1, out_of_range)
    # Before a map is made of ROUTE, which may take long.
    written = {"--out": out, "--save-map": save_map, "--save": save, "--report": report}
    check_apart(written)
    check_page(report)
    if out is not None:
        check_folder(out, "cannot write the fixes")
    named = ModelOptions(model, weights, output)
    reading: dict[str, Any] = {"stride": stride, "every": every, "metres": metres}
    reading |= {"odometry": odometry, "order": order}
    given = None if follow else queries
    rest = {"topic": topic, "strict": strict}
    known = open_route(route, named, save_map, [*(fuse or ()), config], given, **reading, **rest)
    places = known.map
    # For --metres alone there is nothing to say of advances.
    where = None if odometry is None or (metres and not motion) else places.positions
    scale, of = scale_of(where, spacing, places_per_metre)
    refuse(odometry is not None and scale is None and metres is None, NO_SCALE)
    with naming_folders(queries):
        source = frames.open(
            listed(queries),
            topic=topic,
            follow=follow,
            idle=idle,
            gap=gap,
            places_per_metre=scale,
            newest=newest,
            skip_bad=not strict,
            crop=crop_of(places, crop),
            **reading,
        )
    names, maps = [route, *(fuse or ())], [places, *others_of(places, fuse or ())]
    networks = networks_of(maps, names, named, source, made=known.network)
    try:
        scanned = [each.with_screen(screen) if screen else each for each in maps]
        localizer = Localizer(scanned, descriptor=networks, config=settings)
    except SurefixValueError as error:
        raise typer.BadParameter(str(error)) from None
    if screen and (motion or fuse):
        kind = options.get("motion") or "of --config"
        why = f"--motion {kind}" if motion else "--fuse"
        say(f"--screen: unused, as {why} needs all distances", file=sys.stderr)
    elif screen and len(places.blank):
        why = f"{plural(len(places.blank), 'place')} of the map that show nothing"
        say(f"--screen: unused, for the sake of {why}", file=sys.stderr)
    others = [*names, *known.files, *source.files, odometry, config, *named.files]
    read = [Path(each) for each in others if each is not None]
    if out is not None:
        check_not_read(out, read)
        read.append(out)
    try:
        form = form_of(out or Path(), form, "--out", "--format")
        by_name = _named_by_time(source)
        check_form(form, places, source.timed or source.live or by_name)
    except SurefixValueError as error:
        raise typer.BadParameter(str(error)) from None
    refuse(spreadsheet and form != "csv", f"--spreadsheet: expected CSV, got --format {form}")
    refuse(form == "mcap" and out is None, "--format mcap: expected --out FILE, got none")
    if save is not None:
        _check_save(save, read)
    if report is not None:
        check_not_read(report, read, "--report")
    clipping = Clipping(places.levels)
    kind = options.get("motion") or (motion and "of the settings")
    summary = Summary(kind, accept, settings.options["tolerance"])
    if settings.threshold is not None:
        say(f"--config {config}: {settings.threshold.promise}", file=sys.stderr)
    with ExitStack() as opened:
        # First, so that a view which cannot be opened leaves the file as it was.
        page = opened.enter_context(page_of(report, open_))
        pairs = known.pictures if references is None else (references, topic)
        shown: Any = {"live": live, "save": save, "references": pairs}
        shown["report"] = None if page is None else (page, title_of(queries, route))
        seen = open_views(places, source.estimate, **shown)
        views = opened.enter_context(seen)
        kept: list[tuple[Path, bool]] = []
        saved = ExitStack()
        told = lambda *rows: kept.append(rows)  # noqa: E731
        file = None if out is None else saved.enter_context(created(out, form, told))
        try:
            with saved:
                try:
                    with _writer(file, form, places, spreadsheet) as write:
                        localize(localizer, source, write, summary, views, clipping, by_name)
                    summary.ended = True
                except KeyboardInterrupt:
                    # This is the way to end live frames.
                    if not source.live:
                        raise
        finally:
            # After an unreadable frame, the fixes before it are kept.
            so_far = [name for name, earlier in kept if not earlier]
            said = summary.lines(None if so_far else out)
            said += [] if out is None else [words_on_kept(out, *rows) for rows in kept]
            if out is None and sys.stdout.isatty() and summary.latencies:
                said.append("not kept: add -o fixes.csv")
            said += [f"Made {page}"] if page is not None and summary.latencies else []
            said += [] if clipping.warning is None else [clipping.warning]
            said += ["; ".join(notes)] if (notes := notes_on(source)) else []
            said += [_said(source, of, motion)] if isinstance(source, Advances) else []
            said = [line for each in said for line in fitted(each, sys.stderr)]
            leave_room(views, said)
            # On a free terminal.
            opened.close()
            say(*said, file=sys.stderr)
            if page is not None and summary.latencies:
                show(page, open_)


def localize(
    localizer: Localizer,
    source: Frames,
    write: Writer | None,
    summary: Summary,
    views: Sequence[View] = (),
    clipping: Clipping | None = None,
    by_name: bool = False,
) -> None:
    """Push each frame, write and count each fix, and show it in the views. Frames have the times of
    their own, or ``by_name``.
    """
    names, levels = localizer.map.names, localizer.map.levels
    degrees = map_degrees(localizer.map)
    before: Size | None = None
    with closing(source.frames()) as queries:
        for frame in queries:
            if frame.breaks:
                # The advance, which counts from the frame before, bridges the gap.
                localizer.gap(None if frame.advance is None else 0.0)
            start = time.perf_counter_ns()
            try:
                fix = localizer.push(frame.image, advance=frame.advance)
            except SurefixValueError as error:
                raise _at(frame, before, error) from None
            latency = (time.perf_counter_ns() - start) / 1000
            if before is None and (warning := other_shape(localizer.map.image_size, frame.image)):
                say(warning, file=sys.stderr)
            before = frame.image.shape
            if clipping is not None:
                clipping.add(frame.image)
            if views and frame.image.dtype == np.uint16:
                frame = replace(frame, image=in_8_bits(frame.image, levels))
            place_name = names[fix.place] if names else None
            timed = source.timed or source.live
            alarm = localizer.alarm
            if alarm and summary.alarm is None and all(isinstance(v, RunPage) for v in views):
                say(ALARM.format(fix.frame), file=sys.stderr)
            row = row_of(frame, fix, place_name, latency, timed, summary.track.accept, degrees)
            row |= {} if fix.accepted is None else {"alarm": alarm}
            row |= {"time": time_in(frame.name)} if by_name else {}
            if write is not None:
                write(row, partial(getattr, localizer, "belief"))
            summary.add(frame, fix, latency, alarm)
            for view in views:
                view.update(frame, fix, localizer, latency)


def _named_by_time(source: Frames) -> bool:
    """Whether all images of a folder are named by their times."""
    while isinstance(source, Derived):
        source = source.source
    names = source.images.names if isinstance(source, ImageFrames) else []
    return bool(names) and all(time_in(Path(name).name) is not None for name in names)


def _said(source: Advances, of: str, motion: object) -> str:
    """The odometry that was used, in a line."""
    track = source.odometry
    parts = [f"odometry: {track.source}, {source.places_per_metre:.3g} places a metre ({of})"]
    parts += [] if track.along is not None else ["no heading, so that reversing is not seen"]
    outside = f"{plural(source.outside, 'frame')} before its first or after its last time"
    parts += [outside] if source.outside else []
    parts += ["unused with --motion none"] if motion is None else []
    return ", ".join(parts)


def _at(frame: Frame, before: Size | None, error: SurefixValueError) -> SurefixValueError:
    """The error with its frame, and the change of size before it, if there was one."""
    shape = frame.image.shape
    sizes = ""
    if before is not None and shape != before:
        was, now = (" x ".join(map(str, size[1::-1])) for size in (before, shape))
        sizes = f" the images change size here, from {was} to {now}:"
    return SurefixValueError(f"{frame.name}:{sizes} {error}")


def _check_save(save: Path, others: list[Path]) -> None:
    refuse(save.suffix != ".rrd", f"--save: expected a name that ends in .rrd, got {save}")
    there = [file for file in others if save.exists() and file.exists()]
    used = save in others or any(save.samefile(file) for file in there)
    refuse(used, f"--save: {save} is read or written here for something else; name another file")


def _writer(
    file: Any, form: Format, route: Map, spreadsheet: bool
) -> AbstractContextManager[Writer | None]:
    """None if the fixes would run over the view on the terminal."""
    to = file or (None if sys.stdout.isatty() else sys.stdout)
    return nullcontext() if to is None else open_writer(to, form, route, spreadsheet)
