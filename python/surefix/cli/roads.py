"""The segments of a map that is made or made longer: breaks and closed roads, found or given."""

import inspect
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
import typer

from surefix import Map, Segments, SurefixValueError
from surefix._words import plural
from surefix.cli.inputs import missing, refuse
from surefix.frames import EveryMetres, Frames
from surefix.frames.advances import time_in
from surefix.frames.noted import Noted
from surefix.frames.sampling import Derived
from surefix.tables.breaks import Break, found_breaks, jumps, said_jump
from surefix.tables.junctions import Ends, ends_of

Float64 = npt.NDArray[np.float64]

Breaks = Annotated[
    list[str] | None,
    typer.Option(
        "--break",
        "--breaks",
        help="The place at which a new segment begins, beside those that are found; once each, or "
        "several with commas: 120,388.",
    ),
]
NoBreaks = Annotated[
    bool,
    typer.Option(
        "--no-breaks", help="Find no breaks by jumps of the positions and gaps between times."
    ),
]
# The flags of a command's parameter ``closed``. ``--open`` is the second one's old name.
CLOSED = {
    "closed": typer.Option(
        "--closed",
        help="Each segment's last place is followed by its first; by default by the positions.",
    ),
    "not_closed": typer.Option("--not-closed", help="No segment is closed."),
    "open": typer.Option("--open", hidden=True),
}


def closable(command: Callable[..., None]) -> Callable[..., None]:
    """Gives a command the flags --closed and --not-closed for its parameter ``closed``: without
    either it is None.
    """

    @wraps(command)
    def with_flags(**given: Any) -> None:
        closed, *opened = (given.pop(name) for name in CLOSED)
        refuse(closed and any(opened), "--closed: expected it or --not-closed, got both")
        command(**given, closed=True if closed else False if any(opened) else None)

    signature = inspect.signature(command, eval_str=True)
    kept = [each for name, each in signature.parameters.items() if name != "closed"]
    flags = [
        inspect.Parameter(
            name, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=Annotated[bool, flag]
        )
        for name, flag in CLOSED.items()
    ]
    with_flags.__signature__ = signature.replace(  # type: ignore[attr-defined]
        parameters=[*kept, *flags]
    )
    return with_flags


@dataclass(frozen=True)
class Wanted:
    """The options: breaks by hand, whether others are found, and whether segments are closed."""

    breaks: tuple[int, ...] = ()
    find: bool = True
    closed: bool | None = None


def wanted(breaks: Sequence[str] | None, no_breaks: bool, closed: bool | None) -> Wanted:
    """The options as they are typed."""
    found: set[int] = set()
    for text in breaks or ():
        parts = text.split(",")
        for part in parts:
            if not part.strip().isdecimal() or not int(part):
                expected = "--break: expected a place from 1 on, or several with commas"
                raise typer.BadParameter(f"{expected}, got {text!r}")
            found.add(int(part))
        unsorted = any(int(a) >= int(b) for a, b in pairwise(parts))
        refuse(unsorted, f"--break: expected ascending places, got {text!r}")
    return Wanted(tuple(sorted(found)), not no_breaks, closed)


def noted(frames: Frames) -> Frames:
    """The frames, whose times are noted as they are read, if they have times."""
    return Noted(frames) if frames.timed else frames


def with_roads(
    route: Map, frames: Frames, asked: Wanted, start: int = 0, file: object = "FILE"
) -> tuple[Map, list[Break], list[str]]:
    """The map with the breaks and closed segments of its places from ``start`` on, the breaks, and
    what to say of closed segments; the map itself if there are none. The ``frames`` are those of
    these places.
    """
    # An old segment without new places stays as it is.
    places, old, where = len(route), route.segments, route.positions
    least = max(start, 1)
    for place in asked.breaks:
        if not least <= place < places:
            expected = f"--break: expected places from {least} to {places - 1}"
            raise typer.BadParameter(f"{expected}, got {place}")
    breaks: dict[int, Break] = {}
    if asked.find:
        way = _along(frames, places - start) if where is None else where[start:]
        found = found_breaks(way, _times(route, frames, start))
        found = [Break(each.place + start, each.why) for each in found]
        if start and where is not None:
            joint = [metres for place, metres in jumps(where) if place == start]
            found += [Break(start, said_jump(metres)) for metres in joint]
        breaks |= {each.place: each for each in found}
    breaks |= {place: breaks.get(place, Break(place)) for place in asked.breaks}
    known = {*old.breaks.tolist()}
    added = [breaks[place] for place in sorted(breaks) if place not in known]
    split = _segments(old, sorted(known | {*breaks}))
    made, notes = closed_by_positions(route, split, asked.closed, start, file)
    return (route if made == old else route.with_segments(made)), added, notes


def closed_by_positions(
    route: Map, split: Segments, asked: bool | None, start: int = 0, file: object = "FILE"
) -> tuple[Segments, list[str]]:
    """The segments, those with places from ``start`` on closed if it is asked, or by positions if
    it is not said; and what to say of them.
    """
    where, ends = route.positions, dict[int, Ends]()
    for index, each in enumerate(split):
        if asked is None and where is not None and each.end > start and not each.closed:
            ends[index] = ends_of(where[each.start : each.end])
    closed = {index for index, each in enumerate(split) if each.closed}
    new = {index for index, each in enumerate(split) if each.end > start}
    closed |= new if asked else {index for index, each in ends.items() if each.closed}
    closed -= new if asked is False else set()
    made = _segments(split, split.breaks.tolist(), closed)
    return made, _said_closed(made, ends, file)


def _segments(old: Segments, breaks: list[int], closed: set[int] | None = None) -> Segments:
    """The segments with these breaks and closed ones; by default closed are those of before that
    have no new break.
    """
    if closed is None:
        split = Segments(old.places, breaks)
        whole = {(each.start, each.end) for each in old if each.closed}
        closed = {i for i, each in enumerate(split) if (each.start, each.end) in whole}
    try:
        made = Segments(old.places, breaks, closed=sorted(closed))
        # A link from the end of a closed segment to its start is one no more.
        follow = {(each.end - 1, each.start) for each in made if each.closed}
        links = [link for link in map(tuple, old.links.tolist()) if link not in follow]
        return Segments(old.places, breaks, closed=sorted(closed), links=links)
    except SurefixValueError as error:
        raise typer.BadParameter(re.sub(r"^option `(\w+)`", r"--\1", str(error))) from None


def _said_closed(made: Segments, ends: dict[int, Ends], file: object) -> list[str]:
    """Which segments are closed, and which go round more than once."""
    notes = []
    closed = [index for index, each in enumerate(made) if each.closed]
    if closed and len(made) == 1:
        by = f" ({ends[0].apart:.1f} m apart)" if 0 in ends else ""
        notes.append(f"closed: the last place is followed by the first{by}")
    elif closed:
        which = ", ".join(map(str, closed[:5])) + (" and more" if len(closed) > 5 else "")
        notes.append(f"{len(closed)} of {len(made)} segments closed: {which}")
    for index, each in ends.items():
        if each.again:
            start = made[index].start
            first, last = start + each.again, made[index].end - 1
            lap = f"surefix map cut {file} {start}:{first}"
            rest = f"places {first} to {last} go round a second time"
            notes.append(f"{rest}; {lap} makes it a closed lap")
    return notes


def breaks_without_blank(found: Sequence[Break], before: Map, after: Map) -> list[Break]:
    """The breaks of the map ``after`` places are left out as they show nothing, in its numbers: the
    ``found`` ones of the map ``before``, and those that the places make.
    """
    kept = np.setdiff1d(np.arange(len(before)), before.blank)
    why: dict[int, list[str]] = {place: [] for place in after.segments.breaks.tolist()}
    for each in found:
        place = int(np.searchsorted(kept, each.place))
        if each.why and place in why:
            why[place].append(each.why)
    for place, said in why.items():
        if left := int(kept[place] - kept[place - 1] - 1):
            said.append(f"{plural(left, 'place')} left out")
    return [Break(place, ", ".join(said)) for place, said in why.items()]


def closed_without_blank(before: Map, after: Map, asked: Wanted, file: object) -> list[str]:
    """What to say of closed segments of the map ``after`` places are left out."""
    where, ends = after.positions, dict[int, Ends]()
    for index, each in enumerate(after.segments):
        if asked.closed is None and where is not None and not each.closed:
            ends[index] = ends_of(where[each.start : each.end])
    notes = _said_closed(after.segments, ends, file)
    old, now = (sum(each.closed for each in route.segments) for route in (before, after))
    if now < old:
        links = len(after.segments.links) - len(before.segments.links)
        by = f", with {plural(links, 'link')} from an end to a start" if links > 0 else ""
        them = "it" if old - now == 1 else "them"
        said = f"{plural(old - now, 'segment')} not closed, as places of {them} are left out"
        notes.append(f"{said}: {plural(len(after.segments), 'open segment')}{by}")
    return notes


def _times(route: Map, frames: Frames, start: int) -> list[float | None]:
    """The time of each place from ``start`` on; none if it is not known of all."""
    count, names = len(route) - start, route.names
    unknown: list[float | None] = [None] * count
    if isinstance(frames, Noted):
        times = frames.times
        if len(times) != count and names is not None:
            lost = {*missing(frames.names, names[start:])}
            times = tuple(time for index, time in enumerate(times) if index not in lost)
        return [*times] if len(times) == count else unknown
    if frames.ready is not None or names is None:
        return unknown
    named = [time_in(Path(name).name) for name in names[start:]]
    known = [time for time in named if time is not None]
    # Names that go back are not the clock's.
    ascend = all(a < b for a, b in pairwise(known))
    return named if len(known) == count and ascend else unknown


def _along(frames: Frames, count: int) -> Float64 | None:
    """The way along a drive of which only that is known, by the odometry that it is sampled by."""
    found = sampled_by_metres(frames)
    if found is None or not isinstance(frames, Noted) or len(frames.clocks) != count:
        return None
    at: list[Any] = [None if time is None else found.odometry.at(time) for time in frames.clocks]
    return None if any(each is None for each in at) else np.stack(at)


def sampled_by_metres(frames: Frames) -> EveryMetres | None:
    """The sampling by metres among what was done with the frames."""
    while not isinstance(frames, EveryMetres):
        if not isinstance(frames, Derived):
            return None
        frames = frames.source
    return frames
