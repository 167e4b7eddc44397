"""Where each query was: by a truth, or by positions of the places and of the queries."""

import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Self, TypeAlias

import numpy as np
import numpy.typing as npt
import typer

from surefix import Map
from surefix._terminal import say
from surefix._words import plural
from surefix.baselines.truth import Truth
from surefix.cli.drives import names_and_advances
from surefix.cli.inputs import refuse
from surefix.errors import SurefixValueError, mismatch
from surefix.frames import BagFrames, Frames, ImageFrames, Odometry
from surefix.frames.odometry import NAV_SAT_FIX
from surefix.frames.recording import is_bag, open_recording
from surefix.tables.overlap import ALL, MANY, check_overlap
from surefix.tables.positions import (
    Positions,
    by_name,
    checked,
    in_names,
    on_one_plane,
    planar,
    read_positions,
)
from surefix.tables.truth import read_position_truth, read_truth
from surefix.tables.utm import utm_metres, zone_of

# What is expected if the map's positions came as degrees.
DEGREES = "latitude,longitude, as the map's positions"
Float64: TypeAlias = npt.NDArray[np.float64]
Times: TypeAlias = Sequence[float | None]

# By default, the longest time between two positions that one is interpolated in.
GAP = 2.0
PositionGap = Annotated[
    float,
    typer.Option(
        min=0,
        help="--query-positions with times: a query between two positions that are more than this "
        "many seconds apart is not known.",
    ),
]


@dataclass(frozen=True, eq=False)
class Queries:
    """The queries of a drive: how many; names, times and bag, if there are such; and of a recording
    the row of each among all of its frames, which are ``total``.
    """

    count: int
    names: Sequence[str] = ()
    times: Times = ()
    bag: BagFrames | None = None
    numbers: Sequence[int] = ()
    total: int = 0

    @property
    def lost(self) -> int:
        """The number of frames of the recording that did not come."""
        return max(self.total - self.count, 0)

    def fits(self, rows: int) -> bool:
        """Whether this number of rows is one for each query, or for each frame of the recording."""
        return rows == self.count or (self.lost > 0 and rows == self.total)

    def rows(self, read: Positions) -> Positions:
        """Those of the queries, of a row for each frame of the recording or for each query."""
        if not self.lost or not self.fits(len(read.values)):
            return read
        self.say(read.source, whole := len(read.values) == self.total)
        return replace(read, values=read.values[list(self.numbers)]) if whole else read

    def say(self, source: object, whole: bool) -> None:
        """Says which frames a truth has rows of, if some did not come."""
        lost = sorted({*range(self.total)} - {*self.numbers})
        some = ", ".join(map(str, lost[:3])) + (f" and {self.lost - 3} more" if lost[3:] else "")
        missing = f"{plural(self.lost, 'frame')} of {self.total} did not come ({some})"
        left = "its row is left out" if self.lost == 1 else "their rows are left out"
        came = f"a row for each of the {self.count} that came"
        say(f"{source}: {missing}; {left if whole else came}", file=sys.stderr)


@dataclass(frozen=True, eq=False)
class Places:
    """The places of a map: how many, and their positions and names, if they are known; and the
    origin and the UTM zone of the positions.
    """

    count: int
    positions: Float64 | None = None
    names: Sequence[str] | None = None
    origin: tuple[float, float] | None = None
    zone: str | None = None

    @classmethod
    def of(cls, route: Map) -> Self:
        """Those of a map."""
        zone = zone_of(route)
        return cls(len(route), route.positions, route.names, route.origin, zone)


@dataclass(frozen=True, eq=False)
class Where:
    """A truth as ``surefix.evaluate`` takes it, and its tolerance."""

    truth: Truth
    tolerance: float

    @property
    def by_position(self) -> bool:
        """Whether the truth is positions, and the tolerance in metres."""
        return isinstance(self.truth, tuple)

    @property
    def along(self) -> Float64 | None:
        """The way along the drive of each query, in metres; None without positions. Those that are
        not known lie between their neighbours.
        """
        if not isinstance(self.truth, tuple):
            return None
        here = np.asarray(self.truth[1], np.float64)
        known = np.flatnonzero(np.isfinite(here).all(axis=1))
        index = np.arange(len(here))
        filled = np.stack([np.interp(index, known, here[known, k]) for k in range(here.shape[1])])
        steps = np.linalg.norm(np.diff(filled, axis=1), axis=0)
        return np.concatenate(([0.0], np.cumsum(steps)))


def by_truth(source: str, places: Places, queries: Queries, tolerance: float | None) -> Where:
    """The truth of ``--truth``."""
    found = read_position_truth(source)
    if found is None:
        part = tolerance is not None and not float(tolerance).is_integer()
        refuse(part, f"--tolerance: expected a whole number of places, got {tolerance}")
        wide = tolerance is not None and tolerance >= places.count
        expected = f"--tolerance: expected less than the {places.count} places of the map"
        refuse(wide, f"{expected}, within which every match is right; got {tolerance}")
        truth = _read_truth(source, places.count, queries)
        if tolerance is not None:
            _check_tolerance(truth, places.count, int(tolerance))
        if truth.dtype != bool and not (truth >= (1 if truth.ndim == 2 else 0)).any():
            unknown = bool(np.isnan(truth).all()) if truth.dtype.kind == "f" else False
            says = "of no query is the place known" if unknown else "no query has a place"
            say(f"Warning: {source}: {says}, so that no match can be right", file=sys.stderr)
        if truth.dtype.kind == "f":
            _say_unknown(source, int(np.isnan(truth).sum()), queries.count)
        return Where(truth, 1 if tolerance is None else int(tolerance))
    metres = found.metres if tolerance is None else tolerance
    if metres is None:
        expected = "--tolerance: expected how many metres from the truth are right, got none"
        raise typer.BadParameter(f"{expected}, as {source} holds positions")
    mapped = Positions(f"{source}, utmDb", found.places, said=True)
    driven = Positions(f"{source}, utmQ", found.queries, said=True)
    for read, count, of in ((mapped, places.count, "places"), (driven, queries.count, "queries")):
        if len(read.values) != count and not (of == "queries" and queries.fits(len(read.values))):
            raise mismatch(read.source, f"a row for each of the {count} {of}", len(read.values))
    return _compared(mapped.all_known(), queries.rows(driven), metres)


def _check_tolerance(truth: npt.NDArray[Any], places: int, tolerance: int) -> None:
    """Refuses a tolerance by which almost any match is right, warns of one by which many are."""
    at = truth[truth >= 0] if truth.ndim == 1 else np.empty(0)
    if not len(at) or tolerance <= 1:
        return
    within = np.minimum(at + tolerance, places - 1) - np.maximum(at - tolerance, 0) + 1
    by_chance = float(np.mean(within) / places)
    said = f"a random match would be right for {by_chance:.0%} of the queries"
    expected = "--tolerance: expected one that tells places apart"
    refuse(by_chance >= ALL, f"{expected}, got {tolerance} of {places} places: {said}")
    if by_chance >= MANY:
        large = f"the tolerance of {tolerance} is large beside the route of {places} places"
        say(f"Warning: {said}: {large}", file=sys.stderr)


def _read_truth(source: str, places: int, queries: Queries) -> npt.NDArray[Any]:
    """A truth with a row for each query, or for each frame of their recording."""
    if not queries.lost:
        return read_truth(source, places, queries.count)
    # Query i is frame i, unless the places are too few: they may lack the same frames.
    all_first = source == "identity" and queries.total <= places != queries.count
    counts = [queries.count, queries.total]
    problem: SurefixValueError | None = None
    for count in reversed(counts) if all_first else counts:
        try:
            truth = read_truth(source, places, count)
        except SurefixValueError as error:
            problem = problem or error
            continue
        whole = count == queries.total
        queries.say(f"--truth {source}" if source == "identity" else source, whole)
        return truth[..., list(queries.numbers)] if whole else truth
    assert problem is not None
    numbers = f"{queries.count} of {queries.total} frames of the recording came"
    raise SurefixValueError(f"{problem} ({numbers})")


def by_positions(
    positions: Path | None,
    driven: str | Path,
    places: Places,
    queries: Queries,
    tolerance: float,
    gap: float = GAP,
) -> Where:
    """The truth of ``--positions`` and ``--query-positions``, in metres on one plane."""
    mapped, read = _of_places(positions, places), _read_queries(driven, queries)
    # Before they are counted: of another unit, they are of another kind altogether.
    on_one_plane(mapped, read)
    mapped = _each(mapped, places.count, "--positions").all_known()
    return _compared(mapped, _of_queries(driven, read, queries, gap), tolerance)


def positions_of_frames(positions: Path, frames: Frames, old: Map | None = None) -> Positions:
    """Those of a map's places in metres, a row a frame; by their times, if the file has times.
    Degrees become metres about the origin of the ``old`` map that they make longer, by default
    about their middle.
    """
    read = read_positions(positions)
    listed = isinstance(frames, ImageFrames) and frames.ready is None
    if not listed and (read.times is None or not frames.timed):
        if frames.ready is None:
            names, _, times, numbers, total, _ = names_and_advances(frames)
            read = Queries(len(names), names, times, None, numbers, total).rows(read)
    else:
        names, _, times, *_ = names_and_advances(frames)
        queries = Queries(len(names), names, times)
        read = _of_queries(positions, read, queries, GAP, "--positions")
    origin = None if old is None else old.origin
    if old is not None and old.positions is not None:
        if read.degrees and (zone := zone_of(old)) is not None:
            metres = utm_metres(read.values, zone)
            read = replace(read, values=metres, degrees=False, zone=zone)
        if read.degrees and origin is None:
            raise mismatch(read.source, "metres, as the map's, which has no origin", "degrees")
        if not read.degrees and origin is not None:
            raise mismatch(read.source, DEGREES, "metres: they share no plane")
        if (zone := zone_of(old)) is not None and read.zone not in (None, zone):
            raise mismatch(read.source, f"zone {zone}, as the map's", read.zone)
    return planar(read.all_known(), origin)


@contextmanager
def naming(positions: Path | None) -> Iterator[None]:
    """Names the file in a refusal of the number of positions."""
    try:
        yield
    except SurefixValueError as error:
        found = re.fullmatch(r"positions: expected (\d+) values, got (\d+)", str(error))
        of_frames = re.match(r".*expected a frame for each of \d+ positions,", str(error))
        if positions is None or (found is None and of_frames is None):
            raise
        if found is None:
            said = str(error).replace(" positions,", f" positions in {positions},")
            raise SurefixValueError(said) from None
        raise mismatch(positions, f"{found[1]} rows, one for each place", found[2]) from None


def _compared(mapped: Positions, driven: Positions, tolerance: float) -> Where:
    there, here, warnings = check_overlap(mapped, driven, tolerance)
    for warning in warnings:
        say(f"Warning: {warning}", file=sys.stderr)
    _say_unknown(driven.source, int(np.isnan(here).any(axis=1).sum()), len(here))
    return Where((there, here), tolerance)


def _say_unknown(source: object, count: int, queries: int) -> None:
    if count:
        said = f"{plural(count, 'query', 'queries')} of {queries} without a known place"
        say(f"{source}: {said}, left out of all figures", file=sys.stderr)


def gps_of(odometry: str | None, queries: str | None) -> str | None:
    """The odometry itself, if it is a topic of NavSatFix in the queries' bag: such positions are on
    the map's own plane, as those of no other odometry are.
    """
    if odometry is None or queries is None or not is_bag(queries):
        return None
    with open_recording(queries, skip_bad=True) as bag:
        topic = bag.topics.get(odometry)
    return odometry if topic is not None and topic.kind == NAV_SAT_FIX else None


def _of_places(positions: Path | None, places: Places) -> Positions:
    """Those of ``--positions``, by default of the map or in its names."""
    if positions is None:
        if places.positions is not None:
            read = Positions("the map", places.positions, said=True)
            return replace(read, zone=places.zone, origin=places.origin)
        named = None if not places.names else in_names(places.names, "the map")
        if named is None:
            expected = "--positions: expected those of the places, as the map has none"
            raise typer.BadParameter(expected)
        return replace(named, names=None)
    read = read_positions(positions, role="places")
    if read.names is not None and places.names:
        rows = by_name(read, places.names)
        if min(rows) >= 0:
            read = read.at(rows)
    return read


def _of_queries(
    driven: object, read: Positions, queries: Queries, gap: float, option: str = "--query-positions"
) -> Positions:
    """A row for each query, or frame of a map: by its name, by its time, or by its number."""
    if read.names is not None and queries.names:
        rows = by_name(read, queries.names)
        found = sum(row >= 0 for row in rows)
        files = any(Path(name).suffix for name in queries.names)
        if files and not found:
            named = f"{', '.join(read.names[:3])} for {', '.join(queries.names[:3])}"
            what = "names of the images in its column of names"
            raise mismatch(read.source, what, f"none that is one: {named}")
        # Frames have numbers, which others may have by chance.
        if files or 2 * found >= len(rows):
            return read.at(rows)
    if read.times is None:
        if not queries.fits(len(read.values)) and queries.times:
            got = f"the shape {read.values.shape}, without times; a column time would do"
            raise mismatch(option, f"{queries.count} rows of 2 or 3 metres", got)
        return _each(queries.rows(read), queries.count, option)
    times = np.array([np.nan if time is None else time for time in queries.times], np.float64)
    clock = read.times[np.isfinite(read.times)]
    if len(times) and len(clock) and np.isfinite(times).any():
        inside = (times >= clock.min()) & (times <= clock.max())
        if inside.any():
            return read.at_times(times, gap)
        if not queries.fits(len(read.values)):
            got = (
                f"positions from {clock.min():.3f} to {clock.max():.3f} s and queries from "
                f"{np.nanmin(times):.3f} to {np.nanmax(times):.3f} s"
            )
            raise mismatch(
                driven, "positions at the times of the queries", f"{got}: two clocks; give both one"
            )
    elif not queries.fits(len(read.values)):
        expected = f"queries with times, as {read.source} has them, or {queries.count} rows"
        raise mismatch(option, expected, f"{len(read.values)} rows, no times")
    return _each(queries.rows(read), queries.count, option)


def _read_queries(driven: str | Path, queries: Queries) -> Positions:
    """Those of a file, of a bag with one topic of them, or of a topic of the queries' own bag."""
    name, path = str(driven), Path(driven)
    if is_bag(path):
        return _of_track(Odometry.from_bag(name))
    if name.startswith("/") and not path.exists() and queries.bag is not None:
        bag = queries.bag
        return _of_track(Odometry.from_bag(bag.place, name, recorded=bag.recorded))
    return read_positions(path, role="queries")


def _of_track(track: Odometry) -> Positions:
    """The poses or the GPS fixes of a topic, with their times."""
    notes = tuple(track.remarks)
    if track.degrees is None:
        return Positions(track.source, track.positions, said=True, times=track.times, notes=notes)
    read = Positions(track.source, track.degrees, True, True, track.times, notes=notes)
    return checked(read)


def _each(read: Positions, count: int, option: str) -> Positions:
    if len(read.values) != count:
        got = f"the shape {read.values.shape}"
        raise mismatch(f"{option} {read.source}", f"{count} rows of 2 or 3 metres", got)
    return read
