"""Positions of frames, in metres or in degrees: files as people have them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from surefix._core import find_images
from surefix.errors import SurefixValueError, mismatch
from surefix.tables.headings import heading, is_time, number, seconds, stamps
from surefix.tables.metres import centre, interpolate, local_metres
from surefix.tables.npy import read_npy
from surefix.tables.rows import cells_of, is_number, read_text
from surefix.tables.utm import utm_metres

Float64 = npt.NDArray[np.float64]
Role = Literal["places", "queries"]

COLUMNS = "x,y[,z] or easting,northing in metres, or latitude,longitude (or lat,lon) in degrees"
_TURN, _POLE = 180.0, 90.0
# A row of 0,0 this many steps from its neighbours is a receiver's without a fix.
_FAR = 20
# The same for rows that repeat, in long steps.
_JUMP = 2.5
# Of the VPR data sets whose images are named @east@north@zone@letter@latitude@longitude@...
_IN_NAME = re.compile(r"^@\s*([-+.\d]+)@\s*([-+.\d]+)@(?:(\d+)@([A-Za-z]?)@)?")
ZONES = "positions of one UTM zone"


@dataclass(frozen=True, eq=False)
class Positions:
    """A row a frame: metres, or latitude and longitude; NaN if it is not known.

    ``said``: the file says which of these it is. ``times`` are those of the rows in seconds,
    ``names`` those of their images, ``zone`` the UTM zone, if they are known; ``origin`` is the
    latitude and longitude that metres are about, if it is known; ``notes`` is what a user should
    know of the reading.
    """

    source: str
    values: Float64
    degrees: bool = False
    said: bool = False
    times: Float64 | None = None
    names: Sequence[str] | None = None
    zone: str | None = None
    origin: tuple[float, float] | None = None
    notes: tuple[str, ...] = ()

    @property
    def known(self) -> npt.NDArray[np.bool_]:
        """Which rows are known, (n,)."""
        return np.asarray(np.isfinite(self.values).all(axis=1), np.bool_)

    def at(self, rows: Sequence[int]) -> "Positions":
        """Some rows, -1 for one that is not known; without times and names."""
        index = np.asarray(rows, np.int64)
        values = np.where((index >= 0)[:, None], self.values[index], np.nan)
        return replace(self, values=values, times=None, names=None)

    def at_times(self, times: Float64, longest_gap: float) -> "Positions":
        """A row for each time in seconds, linear between the known rows around it if these are at
        most ``longest_gap`` seconds apart; else it is not known.
        """
        assert self.times is not None
        known = np.flatnonzero(self.known & np.isfinite(self.times))
        # In its order of time; of equal times the first.
        stamps, first = np.unique(_nanoseconds(self.times[known]), return_index=True)
        values = self.values[known][first]
        if self.degrees:
            values[:, 1] = np.unwrap(values[:, 1], period=360)
        found = np.full((len(times), values.shape[1]), np.nan)
        asked = np.isfinite(times)
        if len(stamps) and asked.any():
            gap = round(longest_gap * 1e9)
            there, sure = interpolate(_nanoseconds(times[asked]), stamps, values, gap)
            there[~sure] = np.nan
            found[asked] = there
        return replace(self, values=found, times=None, names=None)

    def all_known(self, of: str = "place") -> "Positions":
        """Itself; refused if a row is not known."""
        missing = np.flatnonzero(~self.known)
        if len(missing):
            got = f"none for {len(missing)} of {len(self.values)}, the first in row {missing[0]}"
            more = f" ({'; '.join(self.notes)})" if self.notes else ""
            raise mismatch(self.source, f"a position for each {of}", got + more)
        return self


def read_positions(
    path: Path, names: Sequence[str] | None = None, role: Role = "places"
) -> Positions:
    """The positions in a file, or in the names of a folder's images.

    - ``.npy``: 2 or 3 metres a row; ``.npz``: the one array, or Patch-NetVLAD's ``utmQ``, ``utmDb``
      by the ``role``;
    - a table whose header names its columns, in any order, among others; or 2 or 3 metres a row;
    - trajectories: TUM (8 numbers a row), KITTI (12), EuRoC (by its header); ``.gpx``.

    A row that is empty or NaN, or 0,0 or -1,-1 far from its neighbours, is not known. With the
    frames' ``names``, each must have a row; a column ``name`` gives them, in any order.
    """
    suffix = path.suffix.lower()
    if path.is_dir():
        read = in_names([Path(each).name for each in find_images(path)], str(path))
        if read is None:
            got = "names without them"
            raise mismatch(path, "images named @east@north@... by their positions", got)
    elif suffix in (".npy", ".npz"):
        read = _bare(str(path), _array(path, role))
    elif suffix == ".gpx":
        read = _gpx(path)
    else:
        read = _table(path, names is not None)
    read = checked(read)
    return read if names is None else _of_names(read, path, names).all_known("image")


def checked(read: Positions) -> Positions:
    """The same with rows of no fix as not known; refused if it is degrees that do not say so, or
    that are not on the globe.
    """
    read = _without_zeros(read)
    if _look_like_degrees(read):
        first = read.values[read.known][0].tolist()
        got = f"numbers that look like latitude and longitude, such as {first}"
        advice = "give a .csv with the header latitude,longitude, or metres (header x,y)"
        raise mismatch(read.source, "metres", f"{got}; {advice}")
    return _on_globe(read) if read.degrees else read


def planar(read: Positions, origin: tuple[float, float] | None = None) -> Positions:
    """In metres, with the origin: degrees become metres about it, by default about their middle."""
    if not read.degrees:
        return read
    known = read.values[read.known]
    if origin is None and not len(known):
        raise mismatch(read.source, "positions", "none that is known")
    origin = origin or centre(known[:, 0], known[:, 1])
    return replace(read, values=_planar(read.values, origin), degrees=False, origin=origin)


def on_one_plane(references: Positions, queries: Positions) -> tuple[Float64, Float64]:
    """Both in metres; degrees become metres of the references' UTM zone, or about their origin, by
    default their middle. If only one has heights, they are left out.
    """
    if queries.degrees and not references.degrees and references.zone is not None:
        metres = utm_metres(queries.values, references.zone)
        queries = replace(queries, values=metres, degrees=False, zone=references.zone)
    if queries.degrees and references.origin is not None:
        queries = planar(queries, references.origin)
    if references.degrees != queries.degrees:
        given, other = (references, queries) if references.degrees else (queries, references)
        expected = f"latitude,longitude as in {given.source}"
        raise mismatch(other.source, expected, "metres: they share no plane")
    if references.origin is not None and not queries.degrees and queries.origin is None:
        expected = f"latitude,longitude, as the positions of {references.source}"
        raise mismatch(queries.source, expected, "metres: they share no plane")
    zones = references.zone, queries.zone
    if None not in zones and zones[0] != zones[1]:
        got = f"zone {zones[0]} in {references.source} and {zones[1]} in {queries.source}"
        raise mismatch(queries.source, ZONES, got)
    there, here = references.values, queries.values
    if references.degrees:
        plane = planar(references)
        return plane.values, planar(queries, plane.origin).values
    axes = min(there.shape[1], here.shape[1])
    return there[:, :axes], here[:, :axes]


def in_names(names: Sequence[str], source: str) -> Positions | None:
    """The positions in the names of images, ``@east@north@...``; None if they hold none."""
    found = [(name, _IN_NAME.match(name)) for name in names]
    hits = [(name, hit) for name, hit in found if hit is not None]
    if not hits or len(hits) < len([name for name in names if name.startswith("@")]):
        return None
    try:
        values = np.array([[float(hit[1]), float(hit[2])] for _, hit in hits])
    except ValueError:
        return None
    zones = {f"{hit[3]}{hit[4]}" for _, hit in hits if hit[3]}
    if len(zones) > 1:
        raise mismatch(source, ZONES, f"the zones {', '.join(sorted(zones))}")
    own = [name for name, _ in hits]
    return Positions(source, values, said=True, names=own, zone=next(iter(zones), None))


def _nanoseconds(seconds_: Float64) -> npt.NDArray[np.int64]:
    return np.round(seconds_ * 1e9).astype(np.int64)


def _planar(degrees: Float64, origin: tuple[float, float]) -> Float64:
    known = np.isfinite(degrees).all(axis=1)
    metres = np.full((len(degrees), 2), np.nan)
    metres[known] = local_metres(degrees[known, 0], degrees[known, 1], origin)
    return metres


def _array(path: Path, role: Role) -> Float64:
    """The numbers in a ``.npy`` or a ``.npz``."""
    if path.suffix.lower() == ".npy":
        array = read_npy(path, "the positions")
    else:
        key = {"places": "utmDb", "queries": "utmQ"}[role]
        array = read_npy(path, "the positions", keys=(key, "positions"))
    if array.dtype.kind not in "fiu":
        raise mismatch(path, "rows of 2 or 3 numbers", f"{array.dtype} {array.shape}")
    return np.asarray(array, np.float64)


def _bare(source: str, values: Float64, numbers: Sequence[int] | None = None) -> Positions:
    """Rows of numbers without a header."""
    if values.ndim != 2 or values.shape[1] not in (2, 3):
        raise mismatch(source, "rows of 2 or 3 numbers", f"the shape {values.shape}")
    if values.shape[1] == 3 and np.isnan(values[:, 2]).all():
        values = values[:, :2]
    wrong = np.argwhere(np.isinf(values))
    if len(wrong):
        row = wrong[0, 0] if numbers is None else numbers[wrong[0, 0]]
        raise mismatch(f"{source}, row {row}", "finite numbers", values[tuple(wrong[0])])
    values = np.array(values)
    # Half of a position is none.
    values[np.isnan(values).any(axis=1)] = np.nan
    return Positions(source, values)


def _table(path: Path, whole: bool) -> Positions:
    """A table with a header, a trajectory, or bare numbers."""
    table = cells_of(path, "the positions")
    if not table:
        raise mismatch(path, "a row of 2 or 3 numbers a place", "none")
    width = len(table[0][1])
    for row, cells in table:
        if len(cells) != width:
            raise mismatch(f"{path}, row {row}", f"{width} values", len(cells))
    first = table[0][1]
    if any(is_number(cell) for cell in first) or not any(cell.strip() for cell in first):
        return _trajectory(path, table, whole)
    return _by_header(path, [heading(cell) for cell in first], table, whole)


def _trajectory(path: Path, table: list[tuple[int, list[str]]], whole: bool) -> Positions:
    """Numbers without a header: 2 or 3 metres, TUM or KITTI."""
    width, numbers = len(table[0][1]), [row for row, _ in table]
    if width not in (2, 3, 4, 8, 12):
        expected = "a row of 2 or 3 numbers a place, TUM's 8 or KITTI's 12, or a header"
        raise mismatch(f"{path}, row {numbers[0]}", expected, f"{width} values")
    values = np.array(
        [[number(cell, path, row, "a coordinate", whole) for cell in cells] for row, cells in table]
    )
    if width == 12:
        return replace(_bare(str(path), values[:, [3, 7, 11]], numbers), said=True)
    if width == 8:
        read = _bare(str(path), values[:, 1:4], numbers)
        return replace(read, said=True, times=seconds(values[:, 0]))
    if width in (3, 4) and is_time(values[:, 0]):
        return replace(_bare(str(path), values[:, 1:], numbers), times=seconds(values[:, 0]))
    return _bare(str(path), values, numbers)


def _gpx(path: Path) -> Positions:
    """The points of a GPX file's tracks, else of its routes, else its waypoints."""
    try:
        points = list(ElementTree.fromstring(read_text(path, "the positions").encode()).iter())
    except ElementTree.ParseError as error:
        raise mismatch(path, "a GPX file", error) from None
    for kind in ("trkpt", "rtept", "wpt"):
        found = [each for each in points if each.tag.rpartition("}")[2] == kind]
        if not found:
            continue
        numbers = list(range(len(found)))
        values = [
            [number(each.get(name, ""), path, row, name) for name in ("lat", "lon")]
            for row, each in enumerate(found)
        ]
        times = [each.findtext("{*}time") for each in found]
        known = [time for time in times if time is not None]
        all_ = stamps(known, path, numbers) if len(known) == len(times) else None
        return replace(_bare(str(path), np.array(values)), degrees=True, said=True, times=all_)
    raise mismatch(path, "a GPX file with points", "none")


def _by_header(
    path: Path, header: list[str], table: list[tuple[int, list[str]]], whole: bool
) -> Positions:
    named = {cell.strip().lower() for cell in table[0][1]}
    # The plane of columns named x,y is not known; that of easting,northing is.
    planar_ = {"x", "y"} <= set(header) and not {"x", "y"} <= named
    degrees = {"lat", "lon"} <= set(header) and not planar_
    chosen = ["lat", "lon"] if degrees else ["x", "y"]
    if not set(chosen) <= set(header):
        got = ",".join(table[0][1])
        raise mismatch(f"{path}, row {table[0][0]}", f"the columns {COLUMNS}", got)
    body = table[1:]
    if not body:
        raise mismatch(path, f"a header ({COLUMNS}) and rows", "1 line")
    chosen += ["z"] if not degrees and "z" in header else []
    at = [header.index(name) for name in chosen]
    numbers = [row for row, _ in body]
    values = np.array(
        [
            [number(cells[i], path, row, name, whole) for i, name in zip(at, chosen, strict=True)]
            for row, cells in body
        ]
    )
    read = _bare(str(path), values, numbers)

    def column(name: str) -> list[str] | None:
        found = None if name not in header else header.index(name)
        return None if found is None else [cells[found] for _, cells in body]

    times, zone = column("time"), {*(column("zone") or ())}
    if len(zone) > 1 and not degrees:
        raise mismatch(path, ZONES, f"the zones {', '.join(sorted(zone))}")
    return replace(
        read,
        degrees=degrees,
        said=True,
        times=None if times is None else stamps(times, path, numbers),
        names=column("name"),
        zone=next(iter(zone), None),
    )


def _of_names(read: Positions, path: Path, names: Sequence[str]) -> Positions:
    """The rows of some images, each of which must have one."""
    if read.names is None:
        if len(read.values) != len(names):
            raise mismatch(path, f"a row for each of the {len(names)} images", len(read.values))
        return read
    rows = by_name(read, names)
    lacking = [name for name, row in zip(names, rows, strict=True) if row < 0]
    if lacking:
        got = f"none for {len(lacking)}, such as {lacking[0]}"
        raise mismatch(path, f"a position for each of the {len(names)} images", got)
    return read.at(rows)


def by_name(read: Positions, names: Sequence[str]) -> list[int]:
    """The row of each image by its name, with or without folder and ending; -1 for none."""
    assert read.names is not None
    row_of: dict[str, int] = {}
    for row, name in enumerate(read.names):
        if row_of.setdefault(Path(name).name, row) != row:
            raise mismatch(f"{read.source}, row {row + 2}", "each image once", f"{name} twice")
    stems = {Path(name).stem: row for name, row in row_of.items()}
    found = (row_of.get(Path(name).name, stems.get(Path(name).stem, -1)) for name in names)
    return [int(row) for row in found]


def _without_zeros(read: Positions) -> Positions:
    """Rows of 0,0 and -1,-1 as not known, if they are a receiver's without a fix: in degrees all,
    as no route is there; in metres those far from the rows before and after, as many a robot starts
    at 0,0, and those repeated and left with a jump, as none stands still so.
    """
    none = [(read.values[:, :2] == value).all(axis=1) for value in (0, -1)]
    zero = none[0] | none[1]
    others = np.flatnonzero(~zero & read.known)
    if not zero.any() or len(others) < 2:
        return read
    plane, lost = read.values[others, :2], np.flatnonzero(zero)
    if not read.degrees:
        step = float(np.median(np.linalg.norm(np.diff(plane, axis=0), axis=1)))
        ends = np.vstack([plane[:1], plane, plane[-1:]])
        # The known rows before and after each; at an end the one that there is.
        after = np.searchsorted(others, lost) + 1
        here = read.values[lost, :2]
        away = [np.linalg.norm(ends[rows] - here, axis=1) for rows in (after - 1, after)]
        jump = np.minimum(*away)
        fast = float(np.quantile(np.linalg.norm(np.diff(plane, axis=0), axis=1), 0.95))
        # How many rows repeat it.
        runs = np.split(lost, np.flatnonzero(np.diff(lost) > 1) + 1)
        repeated = np.concatenate([np.full(len(run), len(run)) for run in runs])
        left = (repeated > 1) & (jump > max(_JUMP * fast, 1e-9))
        lost = lost[left | (jump > max(_FAR * step, 1e-9))]
    if not len(lost):
        return read
    values = read.values.copy()
    values[lost] = np.nan
    one = len(lost) == 1
    of = " or ".join(
        text for text, rows in zip(("0,0", "-1,-1"), none, strict=True) if rows[lost].any()
    )
    count = f"{len(lost)} {'row' if one else 'rows'} of {of}"
    where = f"row {lost[0]}" if one else f"the first is row {lost[0]}"
    note = f"{read.source}: {count} taken as not known (a receiver without a fix); {where}"
    return replace(read, values=values, notes=(*read.notes, note))


def _on_globe(read: Positions) -> Positions:
    for axis, (name, limit) in enumerate((("latitude", _POLE), ("longitude", 2 * _TURN))):
        beyond = np.flatnonzero(np.abs(read.values[:, axis]) > limit)
        if len(beyond):
            got = f"{read.values[beyond[0], axis]} in row {beyond[0]}"
            swapped = axis == 0 and np.nanmax(np.abs(read.values[:, 1])) <= _POLE
            hint = "; are latitude and longitude swapped?" if swapped else ""
            expected = f"{name}: expected degrees between -{limit:g} and {limit:g}"
            raise SurefixValueError(f"{read.source}: {expected}, got {got}{hint}")
    return read


def _look_like_degrees(read: Positions) -> bool:
    """Whether bare numbers are degrees rather than metres: all lie within a metre of each other, as
    no drive does; or within some, with decimals as degrees have them, far from 0 beside that.
    """
    values = read.values[read.known][:, :2]
    if read.said or len(values) < 2:
        return False
    far = np.sort(np.abs(values).max(axis=0))
    if far[0] > _POLE or far[1] > _TURN:
        return False
    extent = np.ptp(values, axis=0)
    if (extent < 1).all():
        return True
    fine = np.abs(values * 1e3 - np.round(values * 1e3)) > 1e-6
    away = extent < np.abs(np.median(values, axis=0)) / 10
    return bool((extent < 10).all() and fine.any(axis=1).mean() > 0.8 and away.any())
