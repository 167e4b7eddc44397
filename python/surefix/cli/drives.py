"""The frames of a drive and the maps that they are described for."""

import sys
from collections.abc import Collection, Sequence
from contextlib import closing, suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from surefix import Localizer, Map, Sad, SurefixValueError
from surefix._progress import Bar, terminal_bar
from surefix._terminal import say
from surefix._words import plural
from surefix.cli import inputs
from surefix.cli.inputs import refuse
from surefix.cli.networks import ModelOptions, Network, network_of
from surefix.descriptors.extraction import described
from surefix.descriptors.mapping import sad_map
from surefix.errors import mismatch
from surefix.frames import BagFrames, Frames, ImageFrames
from surefix.frames.advances import time_in
from surefix.frames.levels import FULL, Clipping
from surefix.frames.sampling import Derived
from surefix.frames.shape import other_shape
from surefix.tables.columns import Columns

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]


def bag_of(frames: Frames | None) -> BagFrames | None:
    """The bag that the frames are in, whatever was done with them."""
    while isinstance(frames, Derived):
        frames = frames.source
    return frames if isinstance(frames, BagFrames) else None


def others_of(first: Map, fuse: Sequence[str | Path]) -> list[Map]:
    """The maps of other techniques, of the same places as the first."""
    maps = [open_map(str(file)) for file in fuse]
    for file, each in zip(fuse, maps, strict=True):
        if len(each) != len(first):
            raise mismatch(f"--fuse {file}", f"a map of {len(first)} places", len(each))
    return maps


def open_map(route: str) -> Map:
    """The map; a folder of images is none yet."""
    if Path(route).is_dir():
        got = f"a folder of images; make a map of it: surefix map build {route}"
        raise mismatch(route, "a map", got)
    return Map.open(route)


def networks_of(
    maps: Sequence[Map],
    names: Sequence[object],
    wanted: ModelOptions,
    frames: Frames | None = None,
    argument: str = "QUERIES",
    *,
    made: Network | None = None,
) -> list[Network | None]:
    """The network that describes the frames (by default images) for each map: none for SAD, or if
    they are ready descriptors. Of several maps, ``--model`` is that of those of learned
    descriptors; the network that the first was ``made`` with here is at hand. Refuses frames that
    a map cannot take.
    """
    source: Any = frames
    while not isinstance(source, ImageFrames) and isinstance(source, Derived):
        source = source.source
    if frames is not None and source.ready is not None:
        got = f"got the ready descriptors {frames.files[0]}"
        refuse(wanted.model is not None, f"--model: expected images, {got}")
        return [None] * len(maps)
    networks: list[Network | None] = [] if made is None else [made]
    for each, name in list(zip(maps, names, strict=True))[len(networks) :]:
        by_network = each.descriptor is None or len(maps) == 1
        network = network_of(each, str(name), wanted) if by_network else None
        if network is None and each.descriptor is None:
            raise _no_images(each, argument)
        networks.append(network)
    return networks


def _no_images(place_map: Map, argument: str) -> SurefixValueError:
    """The refusal of images for a map of descriptors that cannot be made of them here."""
    name = None if place_map.recipe is None else place_map.recipe.get("name")
    own = f"is by {str(name)!r}, neither an ONNX file nor a model of `surefix models`"
    why = f"as this map {'holds ready descriptors' if name is None else own}"
    return SurefixValueError(
        f"{argument}: expected descriptors, a .npy (m, dim), {why}; got images"
    )


class Listed(NamedTuple):
    """The name, the advance and the time of each frame; the last two are empty if unknown. Of a
    recording the row of each among all of its frames, and how many these are; and the frames that
    come after a gap.
    """

    names: list[str]
    advances: list[float | None]
    times: list[float | None]
    numbers: list[int]
    total: int
    breaks: Sequence[int] = ()


def names_and_advances(frames: Frames) -> Listed:
    """Those of each frame; a recording is read for them."""
    if isinstance(frames, ImageFrames):
        names = frames.images.names
        # Files may be named by their times.
        times = [time_in(Path(name).name) for name in names]
        return Listed(names, [], [] if None in times else times, [*range(len(names))], len(names))
    listed, breaks = Listed([], [], [], [], 0), []
    bar = Bar(terminal_bar("Counting"), None, frames.estimate)
    with closing(frames.shots()) as shots:
        for shot in shots:
            breaks += [len(listed.names)] if shot.gap or shot.dropped else []
            listed.numbers.append(len(listed.names) if shot.number is None else shot.number)
            listed.names.append(shot.name)
            listed.advances.append(shot.advance)
            listed.times.append(time_in(shot.name) if shot.time is None else shot.time)
            bar.show(len(listed.names))
    bar.end(len(listed.names))
    if not listed.names:
        raise mismatch(frames.files[0], "frames", "none")
    last = listed.numbers[-1] + 1
    return listed._replace(total=max(last, len(listed.names), frames.total or 0), breaks=breaks)


def known(advance: Sequence[float | None]) -> Float64:
    """The advances of frames that all lie within the odometry's times; the first has none."""
    unknown = advance[1:].count(None)
    got = f"none for {plural(unknown, 'frame')}"
    refuse(unknown > 0, f"--odometry: expected positions at the times of all frames, got {got}")
    return np.array([0.0, *advance[1:]], np.float64)


def describe(
    place_map: Map,
    frames: Frames,
    network: Network | None,
    cache: Path | None = None,
    bad: set[int] | None = None,
) -> npt.NDArray[Any]:
    """The descriptors of the frames, as the map's own, (m, dim). With a set ``bad``, images that
    cannot be read are passed over, and their indices are noted in it.
    """
    if frames.ready is not None:
        return np.asarray(frames.ready)
    if network is not None:
        return described(frames, network, cache=cache, levels=place_map.levels, bad=bad)[0]
    sad = place_map.descriptor
    assert sad is not None
    # A map of 8-bit images has no levels; those of the drive are not measured.
    sad = Sad(sad.size, sad.patch, sad.dtype, sad.levels or FULL)
    # A drive of one size is not asked for: a localizer would not either.
    try:
        made = sad_map(frames, sad, skip_bad=bad is not None, mixed_sizes=True)
    except SurefixValueError as error:
        # The map that is made here is of the queries.
        if str(error).startswith("map: expected at least 2 places"):
            raise mismatch("QUERIES", "at least 2 queries", 1) from None
        raise
    if bad is not None and isinstance(frames, ImageFrames):
        bad.update(inputs.missing(frames.images.names, made.names or ()))
    return made.descriptors


def without(frames: Frames, bad: Collection[int]) -> Frames:
    """The frames without the images that cannot be read."""
    if not bad or not isinstance(frames, ImageFrames):
        return frames
    return frames.taken(index for index in range(len(frames)) if index not in bad)


def truth_without(truth: Any, bad: Collection[int]) -> Any:
    """A truth without the queries that cannot be read: a row or a column each."""
    if not bad:
        return truth
    if isinstance(truth, tuple):
        return truth[0], np.delete(truth[1], [*bad], axis=0)
    return np.delete(truth, [*bad], axis=-1)


def advance_without(advance: Float64, bad: Collection[int]) -> Float64:
    """The advances of the queries that are left, each with those of the bad ones before it."""
    moved = np.delete(np.cumsum(advance), [*bad])
    return np.diff(moved, prepend=moved[:1])


def look_at(place_map: Map, frames: Frames, crop: bool = False) -> None:
    """Warns of frames of another shape than the map's images, unless they are cut to it; and of
    frames of more than 8 bits that do not fit its levels.
    """
    if frames.ready is not None:
        return
    clipping, size = Clipping(place_map.levels, every=1), place_map.image_size
    warnings = []
    with closing(frames.shots()) as shots, suppress(SurefixValueError):
        for index, shot in enumerate(shots):
            if index % Clipping.EVERY:
                continue
            image = shot.read()
            if index == 0 and not crop:
                warnings.append(other_shape(size, image))
            if image.dtype != np.uint16:
                break
            clipping.add(image)
    for warning in (*warnings, clipping.warning):
        if warning is not None:
            say(warning, file=sys.stderr)


class MapColumns(Columns):
    """The distances of a map to queries, (m, dim), each computed when it is asked for."""

    def __init__(self, place_map: Map, rows: npt.NDArray[Any]) -> None:
        self._map, self._rows = place_map, rows
        self.shape = len(place_map), len(rows)
        # With running statistics a query's distances depend on those before: a localizer keeps
        # them.
        post = () if place_map.post is None else place_map.post.steps
        self._running = any(step["step"] == "standardize_running" for step in post)
        self._localizer: Localizer | None = None
        self._pushed = 0

    def column(self, query: int) -> Float32:
        """The distances to one query."""
        if not self._running:
            return self._map.distances(self._rows[query])
        if self._localizer is None or query < self._pushed:
            self._localizer, self._pushed = Localizer(self._map, sequence_length=1), 0
        for row in self._rows[self._pushed : query + 1]:
            self._localizer.push(row)
        self._pushed = query + 1
        return self._localizer.distances

    def block(self, start: int, stop: int) -> Float32:
        """Those to some queries."""
        D = np.empty((self.shape[0], stop - start), np.float32, order="F")
        for column, query in enumerate(range(start, stop)):
            D[:, column] = self.column(query)
        return D


def distances_of(
    place_map: Map, rows: npt.NDArray[Any], queries: npt.NDArray[np.int64] | None = None
) -> Float32:
    """Between each place and each query, or some of them in order: shape (n, m)."""
    queries = np.arange(len(rows)) if queries is None else queries
    D = np.empty((len(place_map), len(queries)), np.float32, order="F")
    columns = MapColumns(place_map, rows)
    bar = Bar(terminal_bar("Comparing"), len(queries), len(queries))
    for column, query in enumerate(queries):
        D[:, column] = columns.column(int(query))
        bar.show(column + 1)
    return D
