"""What an interactive report shows: the answers of methods on a drive, query by query."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surefix import Evaluation, Segments
from surefix.baselines import METHODS
from surefix.baselines.distances import Flags, Floats, Places
from surefix.report.album import Album
from surefix.study import Study

__all__ = ["SIDE", "Answers", "Scene", "of_study", "thinned"]

# The most rows and columns of the matrix on a page.
SIDE = 1200

Float32 = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Answers:
    """The answers of one method, one for each of m queries.

    Attributes
    ----------
    name, description : str
    place : array of int, shape (m,)
    score : array of float32, shape (m,)
        Less is better.
    ready, accepted : arrays of bool, shape (m,)
        As of ``surefix.Matches``.
    judged, right : arrays of bool, shape (m,), or None
        By a truth, if there is one.
    confidence, off_map : arrays of float, shape (m,), or None
    distance : array of float32, shape (m,), or None
        Between the query and the place.
    curve : Evaluation, or None
    """

    name: str
    description: str
    place: Places
    score: Float32
    ready: Flags
    accepted: Flags
    judged: Flags | None = None
    right: Flags | None = None
    confidence: Floats | None = None
    off_map: Floats | None = None
    distance: Float32 | None = None
    curve: Evaluation | None = None


@dataclass(frozen=True, eq=False)
class Scene:
    """A drive along a route of n places, as an interactive report shows it.

    Attributes
    ----------
    picture : array of float32, shape (rows, columns)
        The distances, or the least of each block of them.
    block : (int, int)
        The places of a row, and the queries of a column.
    least : bool
        False if the picture has one distance of each block, whichever.
    places : int
    methods : sequence of Answers
    chosen : str
        The name of the method that is shown first.
    trusted : array of bool, shape (m,)
    single_place, single_distance : arrays, shape (m,)
    true_place : array of int, shape (m,), or None
        -1 for a query off the map.
    off_map : array of bool, shape (m,), or None
        Which queries are off the map, by the truth.
    single_right : array of bool, shape (m,), or None
    true_distance : array of float32, shape (m,), or None
    positions : array, shape (n, 2), or None
        Of the places, in metres.
    query_positions : array, shape (m, 2), or None
    segments : Segments, or None
    query_names, place_names : sequence of str, or None
    queries, references : Album
    """

    picture: Float32
    block: tuple[int, int]
    places: int
    methods: Sequence[Answers]
    chosen: str
    trusted: Flags
    single_place: Places
    single_distance: Float32
    true_place: Places | None = None
    off_map: Flags | None = None
    true_distance: Float32 | None = None
    single_right: Flags | None = None
    positions: Floats | None = None
    query_positions: Floats | None = None
    segments: Segments | None = None
    query_names: Sequence[str] | None = None
    place_names: Sequence[str] | None = None
    least: bool = True
    queries: Album = field(default_factory=Album)
    references: Album = field(default_factory=Album)

    def __len__(self) -> int:
        """The number of queries."""
        return len(self.trusted)

    @property
    def judged(self) -> bool:
        """Whether there is a truth."""
        return self.true_place is not None


def thinned(D: Float32, most: int = SIDE) -> tuple[Float32, tuple[int, int]]:
    """The least of each block of distances, at most ``most`` rows and columns, and the places and
    the queries of a block.
    """
    down, across = (max(1, -(-side // most)) for side in D.shape)
    if down > 1:
        D = np.minimum.reduceat(D, np.arange(0, len(D), down), axis=0)
    if across > 1:
        D = np.minimum.reduceat(D, np.arange(0, D.shape[1], across), axis=1)
    return np.ascontiguousarray(D, np.float32), (down, across)


def of_study(
    study: Study,
    *,
    queries: Any = None,
    references: Any = None,
    query_names: Sequence[str] | None = None,
    place_names: Sequence[str] | None = None,
) -> Scene:
    """The scene of a study; ``queries`` and ``references`` are images by number, or albums."""
    n, m = study.distances.shape
    seen, covers = study.seen()
    picture, (down, across) = thinned(seen)
    if covers is not None:
        (_, width), (_, height) = covers
        down, across = down * -(-height // seen.shape[0]), across * -(-width // seen.shape[1])
    held = study.distances if isinstance(study.distances, np.ndarray) else None
    every, run, truth = np.arange(m), study.run, study.true_place

    def at(place: Places) -> Float32 | None:
        return None if held is None else np.asarray(held[place, every], np.float32)

    methods = [
        Answers(
            result.name,
            METHODS[result.name].description,
            matches.place,
            matches.score,
            np.asarray(matches.ready),
            np.asarray(matches.accepted),
            result.judged,
            result.right,
            matches.confidence,
            matches.off_map,
            at(matches.place),
            result.curve,
        )
        for result in study.results
        for matches in (result.matches,)
    ]
    positions: Any = study.context.positions
    query_positions = None
    if study.by_position:
        there, here = (np.asarray(each, np.float64) for each in study.truth)
        positions, query_positions = (there, here) if there.shape[1] > 1 else (None, None)
    positions = None if positions is None else np.asarray(positions, np.float64)
    flat = positions is not None and positions.ndim == 2 and positions.shape[1] > 1
    wanted = {int(place) for each in methods for place in each.place} | {
        *truth[truth >= 0].tolist()
    }
    wanted |= {*run.single_place.tolist()}
    return Scene(
        picture,
        (down, across),
        n,
        methods,
        study.shown.name,
        np.asarray(run.trusted),
        np.asarray(run.single_place),
        np.asarray(run.single_distance),
        truth,
        study.off_map,
        at(np.maximum(truth, 0)),
        study.single_right,
        positions[:, :2] if flat else None,
        query_positions[:, :2] if flat and query_positions is not None else None,
        study.context.segments,
        query_names,
        place_names,
        covers is None,
        _album(queries, every.tolist()),
        _album(references, wanted),
    )


def _album(images: Any, numbers: Any) -> Album:
    if images is None:
        return Album()
    if isinstance(images, Album):
        return images
    if isinstance(images, Mapping):
        numbers = [number for number in numbers if number in images]
    return Album.of(images, numbers)
