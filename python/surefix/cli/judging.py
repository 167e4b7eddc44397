"""Runs for ``surefix compare``, each judged by the truth of the options."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import typer

from surefix import Segments, SurefixValueError, match_distances
from surefix.baselines import Context, run_method
from surefix.cli.drives import Float32, distances_of, open_map, truth_without
from surefix.cli.inputs import refuse
from surefix.cli.networks import ModelOptions
from surefix.cli.recorded import open_drive
from surefix.cli.where import Places, Queries, Where, by_positions, by_truth
from surefix.judged import Judged
from surefix.machine import room_for
from surefix.study.study import Recall
from surefix.tables.columns import is_held
from surefix.tables.npy import read_npy
from surefix.tables.positions import read_positions
from surefix.tables.reports import drive_of, read_fixes
from surefix.tables.truth import KEYS

# More places than any map has: how many the map of some fixes had is not known.
MANY = 1 << 31


@dataclass(frozen=True)
class TruthOptions:
    """The options that say where the queries were."""

    truth: str | None
    positions: Path | None
    query_positions: str | None
    tolerance: float | None
    gap: float

    def of(self, places: Places, queries: Queries) -> Where:
        if self.truth is not None:
            return by_truth(self.truth, places, queries, self.tolerance)
        assert self.query_positions is not None
        assert self.tolerance is not None
        paths = self.positions, self.query_positions
        return by_positions(*paths, places, queries, self.tolerance, self.gap)

    def places_of_fixes(self, queries: int) -> Places:
        """Those of a map that is not there: as many as the truth says."""
        if self.query_positions is not None:
            expected = "--positions: expected those of the places, as fixes have none"
            refuse(self.positions is None, expected)
            assert self.positions is not None
            return Places(len(read_positions(self.positions, role="places").values))
        path = Path(str(self.truth))
        if path.suffix.lower() in (".npy", ".npz"):
            array = read_npy(path, "the truth", keys=KEYS, objects=True)
            if array.ndim == 2 and array.shape[1] == queries and array.shape[0] > 2:
                return Places(len(array))
        return Places(MANY)


@dataclass(frozen=True, eq=False)
class Judging:
    """Makes the matches of fixes, of maps and of distances, judged by the truth of the options."""

    where: TruthOptions
    recall: Recall
    methods: Sequence[str]
    options: dict[str, Any]
    model: ModelOptions
    similarity: bool

    def fixes(self, file: str) -> Judged:
        """The fixes of a run."""
        read = read_fixes(Path(file))
        places = self.where.places_of_fixes(len(read.matches))
        at = self.where.of(places, Queries(len(read.matches), read.queries, read.times))
        how = (at.truth, at.tolerance, self.recall, read.queries, read)
        return Judged.by_truth("", read.matches, *how)

    def drive(self, route: str, queries: str | None, sampling: dict[str, Any]) -> list[Judged]:
        """The methods on a map and a drive, or on distances."""
        learned = queries is not None and open_map(route).descriptor is None
        model = self.model if learned else ModelOptions()
        ready = Ready.open(self.where, route, queries, model, self.similarity, sampling)
        return ready.judged(self.methods, self.options, self.recall)


@dataclass(frozen=True, eq=False)
class Ready:
    """Distances with a truth.

    Attributes
    ----------
    source : str
        The map, the images or the matrix, for errors.
    distances : array of float32, shape (n, m)
    truth, tolerance
        As for ``surefix.evaluate``.
    segments, positions
        Those of the map, if there is one.
    queries : list of str, or None
        The names of the queries.
    drive : str, or None
        A mark of their files.
    """

    source: str
    distances: Float32
    truth: Any
    tolerance: float
    segments: Segments | None = None
    positions: Any = None
    queries: list[str] | None = None
    drive: str | None = None

    @classmethod
    def open(
        cls,
        where: TruthOptions,
        route: str,
        queries: str | None,
        model: ModelOptions,
        similarity: bool,
        sampling: dict[str, Any],
        save_map: Path | None = None,
    ) -> "Ready":
        drive = open_drive(route, queries, (), similarity, model, save_map, **sampling)
        count = len(drive.rows[0]) if drive.maps else drive.rows[0].shape[1]
        if not is_held(drive.places, count):
            size = f"{drive.places} x {count} distances, of {route}"
            room_for(2 * 4 * drive.places * count, size)
        mapped = Places.of(drive.maps[0]) if drive.maps else Places(drive.places)
        recorded = drive.numbers, drive.total
        driven = Queries(count + len(drive.bad), drive.seen, drive.times, drive.bag, *recorded)
        at = where.of(mapped, driven)
        truth = truth_without(at.truth, drive.bad)
        D = distances_of(drive.maps[0], drive.rows[0]) if drive.maps else drive.rows[0]
        segments = drive.maps[0].segments if drive.maps else None
        # Ready descriptors are other files for each map.
        mark = None if drive.queries is None else drive_of(drive.files)
        names = drive.queries
        return cls(route, D, truth, at.tolerance, segments, mapped.positions, names, mark)

    def judged(
        self, methods: Sequence[str], options: dict[str, Any], recall: Recall
    ) -> list[Judged]:
        """The matches of each method."""
        D, truth, segments = self.distances, self.truth, self.segments
        context = Context(truth=truth, truth_tolerance=self.tolerance, segments=segments)
        context = replace(context, positions=self.positions, **options)
        try:
            run = match_distances(D, **context.options)
        except SurefixValueError as error:
            if str(error).startswith("option"):
                raise typer.BadParameter(f"{self.source}: {error}") from None
            raise
        how = (truth, self.tolerance, recall, self.queries, run, segments, self.drive)
        return [Judged.by_truth(name, run_method(name, D, context), *how) for name in methods]
