"""A map of frames and all that is said of it: for ``surefix map build``, and for maps in memory."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from surefix import Map, Sad
from surefix._ray import is_spread
from surefix.cli import inputs
from surefix.cli.info import look, repeated, said_blank, said_repeated
from surefix.cli.inputs import refuse
from surefix.cli.networks import Network
from surefix.cli.roads import (
    Wanted,
    breaks_without_blank,
    closed_without_blank,
    noted,
    sampled_by_metres,
    with_roads,
)
from surefix.cli.where import naming, positions_of_frames
from surefix.descriptors import metric_of
from surefix.descriptors.mapping import map_of_images, sad_map
from surefix.frames import Frames, ImageFrames
from surefix.frames.levels import Levels
from surefix.post import Step
from surefix.tables.breaks import said_breaks
from surefix.tables.positions import Positions
from surefix.tables.utm import UTM

MATCHED = "nothing is matched to them (--skip-blank leaves them out)"


@dataclass(frozen=True)
class Making:
    """How a map is made: its segments, its descriptors (by SAD if there is no network), and its
    pictures, and the plane of its positions, if they do not say it.
    """

    roads: Wanted = field(default_factory=Wanted)
    network: Network | None = None
    sad: Sad = field(default_factory=Sad)
    metric: str | None = None
    post: list[Step] | None = None
    cache: Path | None = None
    levels: Levels | None = None
    strict: bool = False
    mixed_sizes: bool = False
    thumbnails: bool = False
    skip_blank: bool = False
    plane: str | None = None


class Made(NamedTuple):
    """A map, and what to say of it."""

    map: Map
    notes: list[str]


def make(
    place: str,
    frames: Frames,
    how: Making,
    positions: Path | None = None,
    out: Path | None = None,
) -> Made:
    """The map of the frames of a place; with ``out``, in that file."""
    read = None if positions is None else positions_of_frames(positions, frames)
    where = None if read is None else read.values
    plane: dict[str, Any] = {"origin": _plane(read, frames, how.plane)}
    seen: dict[str, Any] = plane | {"thumbnails": how.thumbnails}
    frames = noted(frames)
    in_file = False
    with naming(positions):
        if frames.ready is not None:
            by = how.metric or metric_of(place) or "cosine"
            route = Map.from_descriptors(frames.ready, by, positions=where, post=how.post, **plane)
        elif how.network is not None:
            seen |= {"levels": how.levels, "skip_bad": not how.strict}
            given: Any = (how.network, how.metric or "cosine", where, how.post, how.cache)
            route = map_of_images(frames, *given, **seen)
        else:
            seen |= {"mixed_sizes": how.mixed_sizes}
            if isinstance(frames, ImageFrames):
                check_breaks(how.roads, len(frames))
                seen["skip_bad"] = not how.strict
            in_file = isinstance(frames, ImageFrames) and not is_spread()
            if out is not None and isinstance(frames, ImageFrames) and not is_spread():
                Map.build(out, frames.source, how.sad, positions=where, **seen)
                route = look(out)
            else:
                route = sad_map(frames, how.sad, where, **seen)
    file = out or "FILE"
    made, found, notes = with_roads(route, frames, how.roads, file=file)
    kept = None if frames.ready is not None else made.names
    done = "left out" if how.skip_blank else MATCHED
    blank = said_blank(made.blank.tolist(), made.names, done)
    if how.skip_blank and len(made.blank):
        whole, made = made, made.without_blank()
        # Of the map that is written, in its own numbers.
        found = breaks_without_blank(found, whole, made)
        notes = closed_without_blank(whole, made, how.roads, file)
    notes = [*said_breaks(found), *notes, *blank]
    if stretches := repeated(made.names):
        notes.append(f"warning: {said_repeated(stretches)}")
    if out is not None and not (in_file and made is route):
        made.save(out)
    return Made(made, [*notes, *inputs.notes_on(frames, kept)])


def check_breaks(asked: Wanted, places: int) -> None:
    """Refuses breaks beyond the images before any is read."""
    beyond = [place for place in asked.breaks if place >= places]
    expected = f"--break: expected places from 1 to {places - 1}"
    refuse(bool(beyond), f"{expected}, got {beyond[-1] if beyond else 0}")


def _plane(read: Positions | None, frames: Frames, given: str | None) -> Any:
    """The plane of the positions, or of the odometry, as they or ``--plane`` say: the origin of a
    local one, or the name of another.
    """
    moved = sampled_by_metres(frames)
    known: tuple[float, float] | str | None = None if moved is None else moved.odometry.origin
    if read is not None:
        known = read.origin or (f"{UTM}{read.zone}" if read.zone else None)
    if given is None:
        return known
    refuse(read is None and moved is None, "--plane: expected --positions too, in metres")
    got = f"got those of {known if isinstance(known, str) else f'the origin {known}'}"
    refuse(known is not None, f"--plane: expected positions in metres that name no plane, {got}")
    try:
        latitude, longitude = map(float, given.split(","))
    except ValueError:
        refuse(not given.strip(), "--plane: expected a name, or LATITUDE,LONGITUDE, got none")
        return given
    bad = not (abs(latitude) <= 90 and math.isfinite(longitude))
    refuse(bad, f"--plane: expected a latitude from -90 to 90 and a longitude, got {given}")
    return latitude, longitude
