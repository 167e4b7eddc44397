"""The maps or distances of a command, and the whole drive that goes with them."""

import sys
from collections.abc import Collection, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from surefix import Localizer, Map, Sad, SurefixValueError
from surefix._progress import Bar, terminal_bar
from surefix._words import plural
from surefix.cli import inputs
from surefix.cli.inputs import refuse
from surefix.descriptors import Onnx
from surefix.descriptors.extraction import described
from surefix.descriptors.mapping import sad_map
from surefix.errors import mismatch
from surefix.frames import BagFrames, Frames, ImageFrames
from surefix.frames import open as open_frames
from surefix.frames.advances import time_in
from surefix.frames.levels import FULL, Clipping
from surefix.frames.sampling import Derived
from surefix.frames.shape import other_shape
from surefix.tables.columns import Columns
from surefix.tables.matrices import read_matrix
from surefix.tables.vectors import ENDINGS

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Drive:
    """A whole drive as ``surefix.align`` and ``surefix.audit`` take it.

    Attributes
    ----------
    names : list of str
        The technique of each map or matrix, by its file.
    maps : list of Map
        None of distances.
    rows : list of arrays
        The queries' descriptors for each map, (m, dim); or the distances, (n, m).
    advance : array of float64, shape (m,), or None
        By the odometry, in places.
    queries : list of str, or None
        The name of each query.
    seen : list of str
        The same, with the images that could not be read; of arrays none.
    times : sequence of float or None
        When each of these was taken, in seconds; empty if unknown.
    bad : tuple of int
        The images that could not be read and are no queries, by their index.
    bag : BagFrames, or None
        The bag that the queries are in.
    numbers, total : sequence of int, int
        The row of each query, bad images among them, among the frames of its recording, and their
        number.
    files : sequence of str
        The files that the queries are read from.
    """

    names: list[str]
    maps: list[Map]
    rows: list[npt.NDArray[Any]]
    advance: Float64 | None = None
    queries: list[str] | None = None
    seen: Sequence[str] = ()
    times: Sequence[float | None] = ()
    bad: tuple[int, ...] = ()
    bag: BagFrames | None = None
    numbers: Sequence[int] = ()
    total: int = 0
    files: Sequence[str] = ()

    @property
    def given(self) -> tuple[Any, ...]:
        """The arguments of ``surefix.align``."""
        if not self.maps:
            return (self.rows,)
        return self.maps, self.rows if len(self.maps) > 1 else self.rows[0]

    @property
    def places(self) -> int:
        """The number of places of the map."""
        return len(self.maps[0] if self.maps else self.rows[0])

    def distances(self, technique: int, queries: npt.NDArray[np.int64]) -> Float32:
        """Between each place and some of the queries, in order."""
        if not self.maps:
            return np.asarray(self.rows[technique][:, queries])
        return distances_of(self.maps[technique], self.rows[technique], queries)


def open_drive(
    route: str,
    queries: str | None,
    fuse: Sequence[str],
    similarity: bool,
    model: Path | None,
    spacing: float | None = None,
    places_per_metre: float | None = None,
    order: str = "name",
    strict: bool = False,
    crop: bool = False,
    **sampling: Any,
) -> Drive:
    """Distances; or maps and queries, described for each map, with their advances by odometry."""
    files = [route, *fuse]
    matrices = [Path(file).suffix == ".npy" for file in files]
    matrix = matrices[0]
    refuse(similarity and not matrix, "--similarity: expected a .npy of similarities, got a map")
    kind = "a .npy of distances" if matrix else "a map"
    for file, other in zip(files, matrices, strict=True):
        refuse(other != matrix, f"--fuse {file}: expected {kind}, as {route} is one")
    if matrix:
        refuse(queries is not None, f"QUERIES: expected none with distances, got {queries}")
        refuse(model is not None, f"--model: expected a map, got the distances {route}")
        inputs.check_sampling(f"the distances {route}", **sampling)
        refuse(order != "name" or crop, f"--order, --crop: expected images, got {route}")
        read = [read_matrix(file, similarity) for file in files]
        for file, each in zip(files, read, strict=True):
            if each.shape != read[0].shape:
                raise mismatch(f"--fuse {file}", f"the shape {read[0].shape}", each.shape)
        return Drive(_named(files), [], [*read])
    refuse(queries is None, "QUERIES: expected images or descriptors, got none")
    first = open_map(route)
    maps = [first, *others_of(first, fuse)]
    networks = networks_of(maps, files, model)
    odometry = sampling.get("odometry")
    scaled = spacing is not None or places_per_metre is not None
    refuse(scaled and odometry is None, "--spacing, --places-per-metre: expected --odometry too")
    scale, of = None, ""
    if odometry is not None:
        scale, of = inputs.scale_of(maps[0].positions, spacing, places_per_metre)
        refuse(scale is None, inputs.NO_SCALE)
        sampling["places_per_metre"] = scale
    place = str(queries)
    reading: dict[str, Any] = {"order": order, "strict": strict}
    reading["crop"] = inputs.crop_of(first, crop)
    if odometry is not None and Path(place).suffix.lower() in ENDINGS:
        # Rows of an array, a row of the odometry each.
        how = {"odometry": sampling.pop("odometry"), "places_per_metre": scale}
        del sampling["places_per_metre"]
        frames = inputs.open_frames(place, **reading, **sampling)
        moved = open_frames(place, **how)
    else:
        frames = moved = inputs.open_frames(place, **reading, **sampling)
    for file, place_map, network in zip(files, maps, networks, strict=True):
        check_kind(place_map, file, frames, network)
    names, advances, times, numbers, total, _ = names_and_advances(moved)
    advance = None if odometry is None else known(advances)
    if advance is not None:
        print(f"odometry: {scale:.3g} places a metre ({of})", file=sys.stderr)
    look_at(first, frames, crop)
    bad: set[int] = set()
    rows = []
    for place_map, network in zip(maps, networks, strict=True):
        rows.append(describe(place_map, frames, network, bad=None if strict else bad))
        if len(rows) == 1:
            frames = without(frames, bad)
    seen = [] if frames.ready is not None else names
    names = [name for index, name in enumerate(names) if index not in bad]
    named = None if frames.ready is not None else names
    if advance is not None:
        advance = advance_without(advance, bad)
    if notes := inputs.notes_on(moved, names):
        print("; ".join(notes), file=sys.stderr)
    lost, bag = tuple(sorted(bad)), bag_of(frames)
    rest = numbers, total, moved.files
    return Drive(_named(files), maps, rows, advance, named, seen, times, lost, bag, *rest)


def _named(files: Sequence[str]) -> list[str]:
    """The files' stems, or the whole paths if these are not all different."""
    stems = [Path(file).stem for file in files]
    return stems if len({*stems}) == len(stems) else [*files]


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
    maps: Sequence[Map], names: Sequence[object], model: Path | None
) -> list[Onnx | None]:
    """The network of each map, of the model's file: of several maps, those of learned descriptors
    are the model's.
    """
    alone = len(maps) == 1
    return [
        inputs.network_of(each, name, model)
        if model and (alone or each.descriptor is None)
        else None
        for each, name in zip(maps, names, strict=True)
    ]


def check_kind(place_map: Map, route: str, frames: Frames, network: Onnx | None) -> None:
    """Refuses queries that the map cannot take."""
    source: Any = frames
    while not isinstance(source, ImageFrames) and isinstance(source, Derived):
        source = source.source
    if source.ready is not None:
        got = f"got the ready descriptors {frames.files[0]}"
        refuse(network is not None, f"--model: expected images, {got}")
    elif network is None and place_map.descriptor is None:
        name = None if place_map.recipe is None else str(place_map.recipe.get("name"))
        if name is not None and name.startswith("onnx:"):
            raise inputs.no_model(name, route)
        holds = f"is by {name!r}, which is no ONNX file"
        why = f"as this map {'holds ready descriptors' if name is None else holds}"
        raise SurefixValueError(
            f"QUERIES: expected descriptors, a .npy (m, dim), {why}; got images"
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
    network: Onnx | None,
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
            print(warning, file=sys.stderr)


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
