"""Columns of tables: what their headings mean, numbers that may be missing, and times."""

import re
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import numpy.typing as npt

from surefix.errors import mismatch
from surefix.tables.rows import UNKNOWN, is_number

Float64 = npt.NDArray[np.float64]

# The names of each column, without units and prefixes.
HEADINGS = {
    "x": "x tx px e east easting utm_east utm_easting utm_x utm_e utme",
    "y": "y ty py n north northing utm_north utm_northing utm_y utm_n utmn",
    "z": "z tz pz up height alt altitude elevation ele",
    "lat": "lat latitude",
    "lon": "lon lng long longitude",
    "time": "time timestamp timestamps stamp t ts secs seconds sec unix gps_time datetime",
    "name": "name file filename file_name image image_name path",
    "zone": "zone utm_zone utm_zone_number",
}
_MEANS = {name: key for key, names in HEADINGS.items() for name in names.split()}


def heading(cell: str) -> str:
    """The meaning of a column's heading, such as ``lat`` for ``field.Latitude [deg]``; else itself.

    ``p_RS_R_x`` is EuRoC's, ``field.latitude`` that of ``rostopic echo -p``.
    """
    name = re.sub(r"[\[(].*?[\])]", "", cell.strip().strip("%#'\"").lower()).strip()
    name = re.sub(r"[\s-]+", "_", name.rpartition(".")[2])
    for prefix in ("p_rs_r_", "gps_", "pos_", "position_", "pose_", "wgs84_"):
        name = name.removeprefix(prefix) if name not in _MEANS else name
    for suffix in ("_deg", "_degrees", "_m", "_metres", "_meters", "_s", "_ns", "_ms", "_us"):
        name = name.removesuffix(suffix) if name not in _MEANS else name
    return _MEANS.get(name, name)


def number(cell: str, path: Path, row: int, what: str, whole: bool = False) -> float:
    """A number, or NaN for a cell that says that it is not known; ``whole`` refuses that."""
    if cell.lower() in UNKNOWN and not whole:
        return float("nan")
    if not is_number(cell) or not np.isfinite(float(cell)):
        raise mismatch(f"{path}, row {row}", f"{what}, a finite number", repr(cell))
    return float(cell)


def stamps(cells: list[str], path: Path, numbers: list[int]) -> Float64:
    """Times in seconds, of numbers of any usual unit or of ISO 8601 (UTC without a zone)."""
    if all(is_number(cell) for cell in cells):
        return seconds(np.array([float(cell) for cell in cells]))
    found = []
    for cell, row in zip(cells, numbers, strict=True):
        try:
            moment = datetime.fromisoformat(cell.replace("Z", "+00:00"))
        except ValueError:
            expected = "a time in seconds, or such as 2024-05-01T12:00:00"
            raise mismatch(f"{path}, row {row}", expected, repr(cell)) from None
        moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
        found.append(moment.timestamp())
    return np.array(found)


def seconds(times: Float64) -> Float64:
    """Seconds, of times since 1970 in nano-, micro- or milliseconds."""
    largest = np.nanmax(np.abs(times), initial=0.0)
    unit = next((unit for low, unit in ((1e16, 1e9), (1e14, 1e6), (1e11, 1e3)) if largest > low), 1)
    return times / unit


def is_time(first: Float64) -> bool:
    """Whether a first column is times since 1970: no place lies so far off."""
    return bool(np.isfinite(first).all() and first[0] > 1e8 and (np.diff(first) > 0).all())
