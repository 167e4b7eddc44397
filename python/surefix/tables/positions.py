"""Positions of frames, in metres or in degrees."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from surefix.errors import SurefixError, SurefixValueError, mismatch, refusal
from surefix.tables.metres import centre, local_metres
from surefix.tables.npy import read_npy
from surefix.tables.rows import columns, rows

Float64 = npt.NDArray[np.float64]
DEGREES = (("latitude", "longitude"), ("lat", "lon"))
METRES = (("x", "y", "z"), ("x", "y"), ("easting", "northing"), ("east", "north"))
COLUMNS = "x,y[,z] or easting,northing in metres, or latitude,longitude (or lat,lon) in degrees"


@dataclass(frozen=True, eq=False)
class Positions:
    """A row a frame: metres, or latitude and longitude."""

    source: str
    values: Float64
    degrees: bool = False


def read_positions(path: Path, names: Sequence[str] | None = None) -> Positions:
    """A ``.npy`` or ``.csv`` of 2 or 3 metres a frame; or a ``.csv`` whose header says more.

    With the frames' ``names``, each must have a row; a column ``name`` gives them, in any order.
    """
    if path.suffix != ".npy" and _has_header(path):
        read = _by_header(path, names)
    else:
        read = Positions(str(path), _bare(path))
    if names is not None and len(read.values) != len(names):
        raise mismatch(path, f"a row for each of the {len(names)} images", len(read.values))
    return read


def read_metres(path: Path) -> Float64:
    """As ``read_positions``, for a map: it holds metres."""
    read = read_positions(path)
    if read.degrees:
        advice = "makes metres of them, with one origin for all drives"
        got = f"latitude and longitude; surefix.datasets.local_metres {advice}"
        raise mismatch(path, "metres, as a map holds no degrees", got)
    return read.values


def on_one_plane(references: Positions, queries: Positions) -> tuple[Float64, Float64]:
    """Both in metres; degrees become metres about the mean of the references."""
    if references.degrees != queries.degrees:
        given, other = (references, queries) if references.degrees else (queries, references)
        expected = f"latitude,longitude as in {given.source}"
        raise mismatch(other.source, expected, "metres: they share no plane")
    if not references.degrees:
        return references.values, queries.values
    there, here = references.values.T, queries.values.T
    origin = centre(*there)
    return local_metres(there[0], there[1], origin), local_metres(here[0], here[1], origin)


def _bare(path: Path) -> Float64:
    """Numbers without a header."""
    try:
        if path.suffix == ".npy":
            values = np.asarray(read_npy(path, "the positions"), np.float64)
        else:
            values = np.loadtxt(path, delimiter=",", ndmin=2)
    except SurefixError:
        raise
    except OSError as error:
        raise refusal(path, "cannot read the positions", error) from None
    except ValueError as error:
        expected = "expected a row of 2 or 3 numbers a place"
        raise SurefixValueError(f"{path}: {expected} ({error})") from None
    if _look_like_degrees(values):
        got = f"numbers that look like latitude and longitude, such as {values[0].tolist()}"
        advice = "give a .csv with the header latitude,longitude, or metres (header x,y)"
        raise mismatch(path, "metres", f"{got}; {advice}")
    return values


def _has_header(path: Path) -> bool:
    first = next((cells for _, cells in rows(path, ",")), [])
    return bool(first) and not any(_is_number(cell) for cell in first)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _by_header(path: Path, names: Sequence[str] | None) -> Positions:
    chosen, values, numbers, cells_of = columns(path, (*METRES, *DEGREES), COLUMNS)
    degrees = chosen in DEGREES
    if degrees:
        try:
            local_metres(*values.T)
        except SurefixValueError as error:
            raise SurefixValueError(f"{path}: {error}") from None
    given = None if names is None else cells_of("name")
    if names is not None and given is not None:
        row_of: dict[str, int] = {}
        for index, name in enumerate(given):
            if row_of.setdefault(name, index) != index:
                raise mismatch(f"{path}, row {numbers[index]}", "each image once", f"{name} twice")
        lacking = [name for name in names if name not in row_of]
        if lacking:
            got = f"none for {len(lacking)}, such as {lacking[0]}"
            raise mismatch(path, f"a position for each of the {len(names)} images", got)
        values = values[[row_of[name] for name in names]]
    return Positions(str(path), values, degrees)


def _look_like_degrees(values: Float64) -> bool:
    """Whether all places lie within a metre, no further from 0 than degrees: no drive does."""
    if values.ndim != 2 or values.shape[1] not in (2, 3) or len(values) < 2:
        return False
    plane = values[:, :2]
    far = np.sort(np.abs(plane).max(axis=0))
    return bool((np.ptp(plane, axis=0) < 1).all() and far[0] <= 90 and far[1] <= 180)
