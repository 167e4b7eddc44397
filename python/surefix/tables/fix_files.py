"""Fixes in files: as CSV, JSON lines, GeoJSON, trajectories of TUM and KITTI, and MCAP."""

import io
import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, Protocol, get_args

import numpy as np
import numpy.typing as npt

from surefix._core import Map
from surefix._saving import Kept, written
from surefix.errors import SurefixValueError, mismatch
from surefix.tables.csv_rows import row_writer
from surefix.tables.fix_mcap import OFF, mcap_writer
from surefix.tables.geojson import point
from surefix.tables.route_poses import RoutePoses, quaternion
from surefix.tables.utm import map_degrees

Format = Literal["csv", "json", "geojson", "tum", "kitti", "mcap"]
Row = dict[str, Any]
# Asked for by a format that needs it.
Belief = Callable[[], npt.NDArray[np.float64] | None]

ENDINGS: dict[str, Format] = {
    "": "csv", ".csv": "csv", ".txt": "csv", ".json": "json", ".jsonl": "json", ".ndjson": "json",
    ".geojson": "geojson", ".tum": "tum", ".kitti": "kitti", ".mcap": "mcap",
}  # fmt: skip
NO_DEGREES = (
    "expected a map that knows its latitudes and longitudes, got {}: build it with --positions or "
    "--odometry of degrees"
)
NO_POSITIONS = "expected a map with positions, got none: build it with --positions or --odometry"
NO_TIMES = (
    "expected queries with times, as of a video, a bag or images named by their times, got none"
)


class Writer(Protocol):
    """Writes a fix: its row, and the belief in each place, if it is known."""

    def __call__(self, row: Row, belief: Belief | None = None) -> None: ...


def form_of(path: Path, given: Format | None, what: str, other: str = "") -> Format:
    """The format of a file, by its ending if none is given; ``what`` and ``other`` name both."""
    found = given or ENDINGS.get(path.suffix.lower())
    if found is None:
        *known, last = (ending for ending in ENDINGS if ending not in ("", ".txt"))
        expected = f"a name that ends in {', '.join(known)} or {last}"
        raise mismatch(what, expected + (other and f", or {other}"), path)
    return found


def check_form(form: Format, route: Map | None, timed: bool) -> None:
    """Refuses a format that the map or the queries lack something for."""
    name = "GeoJSON" if form == "geojson" else form.upper()
    if form == "geojson" and (route is None or map_degrees(route, asked=True) is None):
        kind = "none" if route is None or route.positions is None else "metres only"
        raise SurefixValueError(f"{name}: {NO_DEGREES.format(kind)}")
    if form in ("tum", "kitti", "mcap") and (route is None or route.positions is None):
        raise SurefixValueError(f"{name}: {NO_POSITIONS}")
    if form in ("tum", "mcap") and not timed:
        raise SurefixValueError(f"{name}: {NO_TIMES}")


@contextmanager
def open_writer(
    file: Any, form: Format, route: Map | None, spreadsheet: bool = False
) -> Iterator[Writer]:
    """What writes fixes to an open file, of bytes for MCAP and of text for all others; CSV perhaps
    for a spreadsheet.
    """
    if form in ("csv", "json"):
        yield _csv_writer(file, spreadsheet) if form == "csv" else json_writer(file)
        return
    assert route is not None
    if form == "geojson":
        with _geojson_writer(file) as write:
            yield write
        return
    poses = RoutePoses(route)
    if form == "mcap":
        with mcap_writer(file, poses) as write:
            yield write
    else:
        yield _trajectory_writer(file, poses, _tum if form == "tum" else _kitti)


def write_track(
    path: Path | str,
    found: Any,
    map: Map,
    times: npt.ArrayLike | None = None,
    form: Format | None = None,
) -> None:
    """Writes where a drive was, in a format that other tools read.

    - ``.csv`` and ``.json``: a row a query: its place, confidence, segment, and position, in metres
      and in degrees, if the map has them;
    - ``.geojson``: a point a query, on a map whose positions came as degrees;
    - ``.tum``: ``timestamp tx ty tz qx qy qz qw`` a query, without those that are probably off the
      map; ``.kitti``: the 12 numbers of a 3 x 4 pose for each query. The heading is the route's; z
      is 0 if the map has no heights;
    - ``.mcap``: poses for Foxglove and ROS 2, and the row of the query as JSON.

    Parameters
    ----------
    path : path
        A file of that name is replaced.
    found : Run or Alignment
    map : Map
        The map that it was found on.
    times : array of float, shape (m,), optional
        When each query was taken, in seconds; needed by TUM and MCAP.
    form : {"csv", "json", "geojson", "tum", "kitti", "mcap"}, optional
        By default by the file's ending.

    Raises
    ------
    SurefixFileError
        If the file cannot be written.
    SurefixValueError
        For another format, a map that lacks positions or degrees, or times that are missing, not
        finite or of another number.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> from pathlib import Path
    >>> from surefix.datasets import write_track
    >>> where = [[0, 0], [3, 0], [6, 0], [6, 3]]
    >>> route = surefix.Map.from_descriptors(np.eye(4, dtype=np.float32), positions=where)
    >>> run = surefix.match(route, np.eye(4, dtype=np.float32), sequence_length=2)
    >>> write_track("drive.tum", run, route, times=[0.0, 0.5, 1.0, 1.5])
    >>> print(Path("drive.tum").read_text().splitlines()[0])
    0.000000000 0.0000 0.0000 0.0000 0.000000000 0.000000000 0.000000000 1.000000000
    """
    path = Path(path)
    if form is not None and form not in get_args(Format):
        raise mismatch("form", f"one of {', '.join(get_args(Format))}", repr(form))
    form = form_of(path, form, "path", "form=")
    rows = rows_of(found, map, times)
    check_form(form, map, times is not None)
    write_rows(path, form, rows, map)


def write_rows(path: Path, form: Format, rows: Iterable[Row], route: Map | None) -> None:
    """Writes a file of all rows; an older one stays whole until then.

    Raises
    ------
    SurefixFileError
        If it cannot be written.
    """
    with created(path, form) as file, open_writer(file, form, route) as write:
        for row in rows:
            write(row)


@contextmanager
def created(
    path: Path, form: Format, kept: Kept | None = None, problem: str = "cannot write the fixes"
) -> Iterator[Any]:
    """The file to write, as ``written``; open for text, but for MCAP."""
    with written(path, problem, kept) as raw:
        if form == "mcap":
            yield raw
            return
        with io.TextIOWrapper(raw, encoding="utf-8", newline="") as file:
            yield file


def rows_of(
    found: Any, route: Map | None, times: npt.ArrayLike | None = None, least: float | None = None
) -> list[Row]:
    """The row of each query of a ``Run`` or an ``Alignment``: the columns of its ``to_csv``, and
    segment, position and time. With ``least`` a column ``reference``: the place, -1 of less
    confidence.
    """
    names = ("confidence", "off_map", "speed", "single_place", "single_right", "score", "trusted")
    columns: dict[str, Any] = {"query": np.arange(len(found))}
    if least is not None:
        columns["reference"] = np.where(found.confidence >= least, found.place, -1)
    columns["place"] = found.place
    for name in names:
        values = getattr(found, name, None)
        if values is not None:
            columns[name] = values
        if name == "speed" and (interval := getattr(found, "interval", None)) is not None:
            columns["place_low"], columns["place_high"] = interval.T
    if times is not None:
        columns["time"] = _checked(times, len(found))
    if route is not None:
        index = np.array([route.segments.index_of(int(place)) for place in found.place], np.int64)
        first = np.array([road.start for road in route.segments])
        columns["segment"], columns["segment_place"] = index, found.place - first[index]
        if route.positions is not None:
            at = route.positions[found.place].round(4)
            columns |= dict(zip("xyz", at.T, strict=False))
        if (degrees := map_degrees(route)) is not None:
            at = degrees[found.place].round(9)
            columns["latitude"], columns["longitude"] = at.T
    # Of a number that is not known, no NaN, which JSON lacks.
    lists = [
        [None if cell != cell else cell for cell in values.tolist()] for values in columns.values()
    ]
    return [dict(zip(columns, cells, strict=True)) for cells in zip(*lists, strict=True)]


def _checked(times: npt.ArrayLike, count: int) -> npt.NDArray[np.float64]:
    try:
        array = np.asarray(times, np.float64)
    except (TypeError, ValueError):
        raise mismatch("times", "seconds as numbers", repr(times)[:60]) from None
    if array.shape != (count,):
        raise mismatch("times", f"a time for each of the {count} queries", array.shape)
    wrong = np.flatnonzero(~np.isfinite(array))
    if len(wrong):
        raise mismatch("times", "finite seconds", f"{array[wrong[0]]} of query {wrong[0]}")
    return array


def _csv_writer(file: Any, spreadsheet: bool) -> Writer:
    """Writes a line of names, then one line per fix, with booleans in lower case."""
    line = row_writer(file, spreadsheet)
    names: list[str] = []

    def write(row: Row, belief: Belief | None = None) -> None:
        if not names:
            names.extend(row)
            line(names)
        cells = (row.get(name) for name in names)
        line(str(cell).lower() if isinstance(cell, bool) else cell for cell in cells)
        file.flush()

    return write


def json_writer(file: Any) -> Writer:
    """Writes one JSON object per line."""

    def write(row: Row, belief: Belief | None = None) -> None:
        file.write(json.dumps(row) + "\n")
        file.flush()

    return write


@contextmanager
def _geojson_writer(file: Any) -> Iterator[Writer]:
    """Writes one point per fix, without a place if it is probably off the map."""
    between = ""

    def write(row: Row, belief: Belief | None = None) -> None:
        nonlocal between
        at = row["latitude"], row["longitude"]
        file.write(between + json.dumps(point(None if _lost(row) else at, row)))
        between = ",\n"
        file.flush()

    file.write('{"type": "FeatureCollection", "features": [\n')
    try:
        yield write
    finally:
        # After an error too, what was written can be read.
        file.write("\n]}\n")


def _trajectory_writer(
    file: Any, poses: RoutePoses, line: Callable[[Row, RoutePoses], str | None]
) -> Writer:
    """Writes one line per pose."""

    def write(row: Row, belief: Belief | None = None) -> None:
        if (text := line(row, poses)) is not None:
            file.write(text + "\n")
            file.flush()

    return write


def _tum(row: Row, poses: RoutePoses) -> str | None:
    """``timestamp tx ty tz qx qy qz qw``; none without a time or off the map."""
    if row["time"] is None or _lost(row):
        return None
    place = row["place"]
    at = " ".join(f"{metres:.4f}" for metres in poses.positions[place])
    turn = " ".join(f"{part:.9f}" for part in quaternion(float(poses.yaws[place])))
    return f"{row['time']:.9f} {at} {turn}"


def _kitti(row: Row, poses: RoutePoses) -> str:
    """The 12 numbers of the pose; the format has a row for each frame, also off the map."""
    return " ".join(f"{number:.9g}" for number in poses.matrix(row["place"]).ravel())


def _lost(row: Row) -> bool:
    """Whether the fix is probably off the map."""
    return bool(row.get("off_map", 0.0) >= OFF)
