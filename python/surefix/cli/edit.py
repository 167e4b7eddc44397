"""``surefix map join``, ``cut``, ``thin`` and ``traverse``: new maps of old ones."""

import math
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import typer

from surefix import Map, Segments, SurefixValueError, align
from surefix._progress import terminal_bar
from surefix._saving import edited
from surefix._terminal import say
from surefix._words import plural, verb
from surefix.cli import inputs
from surefix.cli.align import refusing_options
from surefix.cli.flags import documented
from surefix.cli.info import look, repeated, said_repeated, size_of
from surefix.cli.inputs import refuse
from surefix.cli.networks import Model, ModelOptions, Weights
from surefix.cli.recorded import open_drive
from surefix.cli.roads import closable, closed_by_positions
from surefix.errors import check_folder
from surefix.tables.junctions import found_links

# Places a query, with motion `any`.
FASTEST = 5
PROBLEM = "cannot write the map"
Out = Annotated[Path | None, typer.Option("--out", "-o")]


@documented
def join(
    files: list[Path],
    out: Annotated[Path, typer.Option("--out", "-o")],
    link_within: float | None = None,
    link: list[str] | None = None,
) -> None:
    """Make one map of several: each begins a new segment.

    Parameters
    ----------
    files: The maps, in order; of one kind of descriptors.
    out: The map to write.
    link_within: Link the end of each road to the roads within this many metres that a vehicle can
        turn into, and those to the roads that begin there, by the maps' positions.
    link: A link for the tracker's motion, once each: FROM:TO, places of the new map.
    """
    start = time.perf_counter()
    refuse(len(files) < 2, f"FILES: expected two maps or more, got {len(files)}")
    low = link_within is not None and not link_within > 0
    refuse(low, f"--link-within: expected metres above 0, got {link_within}")
    given = [_pair("--link", text) for text in link or ()]
    check_folder(out, PROBLEM)
    maps = [look(file) for file in files]
    made = _joined(maps, files)
    links = {*map(tuple, made.segments.links.tolist())}
    notes = []
    if link_within is not None:
        if made.positions is None:
            raise typer.BadParameter("--link-within: expected maps with positions, got none")
        found = {*found_links(made.positions, list(made.segments), link_within)} - links
        notes.append(f"{plural(len(found), 'link')} found within {link_within:g} m")
        links |= found
    links |= {*given}
    if links:
        made = made.with_segments(_linked(made.segments, sorted(links)))
    made.save(out)
    count = plural(len(made.segments), "segment")
    notes.insert(0, f"{count}, {plural(len(links), 'link')}")
    small = [each.thumbnail(0) is not None for each in maps]
    if any(small) and made.thumbnail(0) is None:
        why = f"{sum(small)} of {len(maps)} maps have them"
        why = "they differ in size" if all(small) else why
        notes.append(f"without thumbnails, as {why}")
    notes += said_twice(made)
    _say(f"Joined {len(files)} maps as {out}", out, start, notes)


def _joined(maps: list[Map], files: list[Path]) -> Map:
    """The maps as one; a refusal names the file of the map that does not fit."""
    try:
        return Map.join(maps)
    except SurefixValueError as error:
        found = re.fullmatch(r"map (\d+): (?:cannot append: )?(.*)", str(error), re.DOTALL)
        if found is None or int(found[1]) >= len(files):
            raise
        at = int(found[1])
        said = f"{files[at]}: cannot join to {files[0]}: {found[2]}"
        raise SurefixValueError(said) from None


@documented
@closable
def cut(file: Path, places: str, out: Out = None, closed: bool | None = None) -> None:
    """Keep a stretch of a map's places.

    Parameters
    ----------
    file: The map.
    places: START:END, the first place that is kept and the one after the last; either may be left
        out.
    out: The map to write; the same file by default.
    """
    start = time.perf_counter()
    to = out or file
    with _written(file, out) as own:
        route = look(file)
        first, end = _stretch(places, len(route))
        made = route.cut(first, end)
        segments, notes = closed_by_positions(made, made.segments, closed, file=to)
        made.with_segments(segments).save(own)
    kept = f"Kept places {first} to {end - 1} of {len(route)} in {to}"
    _say(kept, to, start, notes)


@documented
def thin(file: Path, metres: Annotated[float, typer.Option()], out: Out = None) -> None:
    """Keep a place every few metres, by the map's positions.

    Parameters
    ----------
    file: The map.
    metres: The least distance from one place to the next.
    out: The map to write; the same file by default.
    """
    start = time.perf_counter()
    refuse(not 0 < metres < math.inf, f"--metres: expected a number above 0, got {metres:g}")
    to = out or file
    with _written(file, out) as own:
        route = look(file)
        if route.positions is None:
            raise typer.BadParameter(f"--metres: expected a map with positions, {file} has none")
        try:
            made = route.thin(metres)
        except SurefixValueError as error:
            raise SurefixValueError(f"--metres {metres:g}: {error}") from None
        made.save(own)
    kept = f"Kept {len(made)} of {plural(len(route), 'place')} in {to}"
    _say(kept, to, start, [])


@documented
def traverse(
    file: Path,
    drive: inputs.Place | None = None,
    out: Out = None,
    remove: int | None = None,
    label: str | None = None,
    motion: Literal["steady", "free", "any"] = "any",
    least: Annotated[float, typer.Option(min=0, max=1)] = 0.9,
    model: Model = None,
    weights: Weights = None,
    topic: inputs.Topic = None,
    stride: inputs.Stride = 1,
    every: inputs.Every = None,
    metres: inputs.Metres = None,
    odometry: inputs.Odometry = None,
    spacing: inputs.Spacing = None,
    places_per_metre: inputs.PlacesPerMetre = None,
    order: inputs.Order = "name",
    strict: inputs.Strict = False,
    crop: inputs.Crop = False,
) -> None:
    """Add another drive of the same road to a map, as in another season; or take one out again.

    The drive is aligned with the map, without any label; a place is then matched by the nearest of
    its rows.

    Parameters
    ----------
    file: The map.
    drive: The other drive: a folder of images, a pattern, a .npy of images or of descriptors, a
        video or a bag.
    out: The map to write; the same file by default.
    remove: Take this traverse out, as numbered by `surefix map info`; no DRIVE then.
    label: The traverse's name in `surefix map info`; by default that of the drive's folder or file.
    motion: steady if both drives took frames at the same distances, free for 0 to 2 places a
        query, any for 0 to 5.
    least: A query of a lower confidence adds nothing; for each place the surest one is kept.
    """
    start = time.perf_counter()
    to = out or file
    if remove is not None:
        refuse(drive is not None, "--remove: expected no DRIVE, got both")
        with _written(file, out) as own:
            notes = _without(file, own, remove)
        _say(f"Took traverse {remove} out of {to}", to, start, notes)
        return
    if drive is None:
        raise typer.BadParameter("DRIVE: expected another drive of the road, or --remove")
    inputs.refuse_map("DRIVE", drive)
    look(file)
    named = ModelOptions(model, weights)
    inputs.check_not_read(to, [drive, *named.files, odometry])
    sampling: dict[str, Any] = {"topic": topic, "stride": stride, "every": every}
    sampling |= {"metres": metres, "odometry": odometry}
    sampling |= {"order": order, "strict": strict, "crop": crop}
    scale: dict[str, Any] = {"spacing": spacing, "places_per_metre": places_per_metre}
    with _written(file, out) as own:
        driven = open_drive(str(file), drive, (), False, named, **scale, **sampling)
        inputs.check_not_read(to, driven.files)
        given: dict[str, Any] = {"motion": motion, "advance": driven.advance}
        given["progress"] = terminal_bar("Aligning")
        alignment = refusing_options(align, *driven.given, **given)
        route, rows = driven.maps[0], driven.rows[0]
        sure = alignment.confidence >= least
        if doubt := _doubt(alignment.place, sure, driven.advance):
            said = f"{drive} may be a drive of another road than {file}: {doubt}"
            refuse(out is None, f"--out: expected another file to write, as {said}; got none")
            say(f"Warning: {said}", file=sys.stderr)
        made = route.add_traverse(rows, alignment, least=least, label=label or _label(drive))
        made.save(own)
    used = int(sure.sum())
    notes = [
        f"{used} of {plural(len(rows), 'query', 'queries')} {verb(used)} sure (mean confidence "
        f"{float(alignment.confidence[sure].mean()):.2f})",
        f"it covers {made.traverses[-1].rows} of {plural(len(route), 'place')}",
        f"{plural(len(made.traverses), 'traverse')} now",
    ]
    _say(f"Added the traverse {drive} to {to}", to, start, notes)


def _label(drive: str) -> str:
    """The name of the drive's folder or file."""
    files = drive.files if isinstance(drive, inputs.Place) else ()
    path = Path(files[0]).parent if files else Path(drive)
    while any(sign in path.name for sign in "*?["):
        path = path.parent
    return path.name or path.resolve().name


def _doubt(places: Any, sure: Any, advance: Any) -> str:
    """Why the aligned places may be those of another road, in words; empty if nothing says so."""
    used, total = int(sure.sum()), len(sure)
    if not used:
        # Refused as the traverse is added.
        return ""
    if 2 * used < total:
        return f"{used} of {plural(total, 'query', 'queries')} {verb(used)} sure"
    at = np.flatnonzero(sure)
    steps, queries = np.diff(places[at].astype(np.int64)), np.diff(at)
    # As far as `any` motion takes it, or the odometry says.
    most, way = FASTEST * queries, 1
    if advance is not None:
        moved = np.diff(np.cumsum(advance)[at])
        most, way = np.maximum(most, 2 * np.abs(moved)), -1 if moved.sum() < 0 else 1
    wrong = int(((way * steps < 0) | (way * steps > most)).sum())
    if 2 * wrong <= len(steps):
        return ""
    return f"{wrong} of {plural(len(steps), 'step')} between sure queries go back or jump"


def _without(file: Path, own: Path, remove: int) -> list[str]:
    route = look(file)
    count = len(route.traverses)
    refuse(count < 2, f"--remove: expected a map of several traverses, {file} has one")
    expected = f"--remove: expected a traverse from 0 to {count - 1}"
    refuse(not 0 <= remove < count, f"{expected}, got {remove}")
    try:
        made = route.without_traverse(remove)
    except SurefixValueError as error:
        said = re.sub(r"^option `\w+`", "--remove", str(error))
        raise typer.BadParameter(said) from None
    made.save(own)
    return [f"{plural(len(made.traverses), 'traverse')} left"]


def said_twice(route: Map) -> list[str]:
    """A warning of names that come twice."""
    stretches = repeated(route.names)
    return [f"warning: {said_repeated(stretches)}"] if stretches else []


def _say(done: str, out: Path, start: float, notes: list[str]) -> None:
    said = f"{done}: {size_of(out)}, in {time.perf_counter() - start:.1f} s"
    say("; ".join([said, *notes]))


@contextmanager
def _written(file: Path, out: Path | None) -> Iterator[Path]:
    """The file to save to: by default the map's own copy, while no other program writes the map."""
    # What is no map is refused as such.
    look(file)
    if out is None or (out.exists() and out.samefile(file)):
        with edited(file, PROBLEM) as own:
            yield own
        return
    check_folder(out, PROBLEM)
    yield out


def _pair(option: str, text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d+):(\d+)", text)
    if found is None:
        raise typer.BadParameter(f"{option}: expected FROM:TO, two places, got {text!r}")
    return int(found[1]), int(found[2])


def _stretch(text: str, places: int) -> tuple[int, int]:
    found = re.fullmatch(r"(\d*):(\d*)", text)
    if found is None or text == ":":
        raise typer.BadParameter(f"PLACES: expected START:END, such as 100:300, got {text!r}")
    first, end = int(found[1] or 0), int(found[2] or places)
    if not 0 <= first < end <= places:
        expected = f"PLACES: expected a stretch of the {places} places, from 0 to {places}"
        raise typer.BadParameter(f"{expected}, got {text}")
    return first, end


def _linked(segments: Segments, links: list[tuple[int, int]]) -> Segments:
    closed = [index for index, each in enumerate(segments) if each.closed]
    breaks = segments.breaks
    try:
        return Segments(segments.places, breaks, closed=closed, links=links)
    except SurefixValueError as error:
        raise typer.BadParameter(f"--link: {str(error).partition(': ')[2]}") from None
