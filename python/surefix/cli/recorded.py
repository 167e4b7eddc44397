"""A recorded drive, and the maps or the distances that go with it."""

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix import Map
from surefix._terminal import say
from surefix.cli import inputs
from surefix.cli.drives import (
    Float32,
    Float64,
    advance_without,
    bag_of,
    describe,
    distances_of,
    look_at,
    names_and_advances,
    networks_of,
    others_of,
    without,
)
from surefix.cli.drives import known as known_advances
from surefix.cli.inputs import refuse
from surefix.cli.networks import ModelOptions
from surefix.cli.route import is_matrix, open_route
from surefix.errors import mismatch
from surefix.frames import BagFrames
from surefix.frames import open as open_frames
from surefix.tables.matrices import read_matrix
from surefix.tables.vectors import ENDINGS


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
    model: ModelOptions,
    save_map: Path | None = None,
    read: Iterable[Path | str | None] = (),
    spacing: float | None = None,
    places_per_metre: float | None = None,
    order: str = "name",
    strict: bool = False,
    crop: bool = False,
    **sampling: Any,
) -> Drive:
    """Distances; or maps and queries, described for each map, with their advances by odometry. The
    file ``save_map`` must be none that is ``read`` besides.
    """
    files = [route, *fuse]
    matrices = [is_matrix(file) for file in files]
    matrix = matrices[0]
    refuse(similarity and not matrix, "--similarity: expected a .npy of similarities, got a map")
    kind = "a .npy of distances" if matrix else "a map"
    for file, other in zip(files, matrices, strict=True):
        refuse(other != matrix, f"--fuse {file}: expected {kind}, as {route} is one")
    if matrix:
        refuse(queries is not None, f"QUERIES: expected none with distances, got {queries}")
        given = model.model is not None or save_map is not None
        refuse(given, f"--model, --save-map: expected a map or images, got the distances {route}")
        inputs.check_sampling(f"the distances {route}", **sampling)
        refuse(order != "name" or crop, f"--order, --crop: expected images, got {route}")
        found = [read_matrix(file, similarity) for file in files]
        for file, each in zip(files, found, strict=True):
            if each.shape != found[0].shape:
                raise mismatch(f"--fuse {file}", f"the shape {found[0].shape}", each.shape)
        return Drive(_named(files), [], [*found])
    refuse(queries is None, "QUERIES: expected images or descriptors, got none")
    reading: dict[str, Any] = {"order": order, "strict": strict}
    known = open_route(route, model, save_map, [*fuse, *read], queries, **reading, **sampling)
    first = known.map
    maps = [first, *others_of(first, fuse)]
    odometry = sampling.get("odometry")
    scaled = spacing is not None or places_per_metre is not None
    refuse(scaled and odometry is None, "--spacing, --places-per-metre: expected --odometry too")
    scale, of = None, ""
    if odometry is not None:
        scale, of = inputs.scale_of(maps[0].positions, spacing, places_per_metre)
        refuse(scale is None, inputs.NO_SCALE)
        sampling["places_per_metre"] = scale
    place = str(queries)
    reading["crop"] = inputs.crop_of(first, crop)
    if odometry is not None and Path(place).suffix.lower() in ENDINGS:
        # Rows of an array, a row of the odometry each.
        how = {"odometry": sampling.pop("odometry"), "places_per_metre": scale}
        del sampling["places_per_metre"]
        frames = inputs.open_frames(place, **reading, **sampling)
        moved = open_frames(place, **how)
    else:
        frames = moved = inputs.open_frames(place, **reading, **sampling)
    networks = networks_of(maps, files, model, frames, made=known.network)
    names, advances, times, numbers, total, _ = names_and_advances(moved)
    advance = None if odometry is None else known_advances(advances)
    if advance is not None:
        say(f"odometry: {scale:.3g} places a metre ({of})", file=sys.stderr)
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
        say("; ".join(notes), file=sys.stderr)
    lost, bag = tuple(sorted(bad)), bag_of(frames)
    rest = numbers, total, moved.files
    return Drive(_named(files), maps, rows, advance, named, seen, times, lost, bag, *rest)


def _named(files: Sequence[str]) -> list[str]:
    """The files' stems, or the whole paths if these are not all different."""
    stems = [Path(file).stem for file in files]
    return stems if len({*stems}) == len(stems) else [*files]
