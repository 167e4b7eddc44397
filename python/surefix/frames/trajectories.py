"""Trajectories in text files: CSV, TUM, KITTI and EuRoC. Errors name the file and the row."""

import re
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from surefix.errors import mismatch
from surefix.tables.poses import driven, rotations
from surefix.tables.rows import columns, decimal, header_and_rows, read_text, rows, whole

Float64 = npt.NDArray[np.float64]

COLUMNS = "time in seconds, and x,y[,z] or distance in metres"
CHOICES = (("time", "x", "y", "z"), ("time", "x", "y"), ("time", "distance"))
TUM = ("timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw")
KITTI = "the 3 x 4 matrix of a pose, a row after the other"
EUROC = ("x", "y", "z", "w", "x", "y", "z")
# Times above these, since 1970: in seconds they would be thousands of years and more.
EPOCH = ((1e17, 1e9, "nanoseconds"), (1e14, 1e6, "microseconds"), (1e11, 1e3, "milliseconds"))
# The last word of a column's name, as in time_ns or "timestamp [ns]".
UNITS = {"ns": 1e9, "us": 1e6, "ms": 1e3, "s": 1.0, "sec": 1.0, "nanoseconds": 1e9,
         "microseconds": 1e6, "milliseconds": 1e3, "seconds": 1.0}  # fmt: skip
TIME = re.compile(r"(time|timestamp|stamp|t)[ _]*[\[(]?(" + "|".join(UNITS) + r")?[\])]?")
FORMATS = f"a .csv with a header ({COLUMNS}), or a trajectory of TUM, KITTI or EuRoC"


class Trajectory(NamedTuple):
    """Positions (n, d) in metres at times (n,) in seconds; ``along`` (n,) is the distance driven,
    which decreases if the robot reverses, None if unknown. KITTI's rows are one a frame, and may
    have no times. ``remarks`` says how times were read, if not as seconds.
    """

    times: Float64 | None
    positions: Float64
    along: Float64 | None
    by_frame: bool = False
    remarks: tuple[str, ...] = ()


def read_trajectory(path: Path) -> Trajectory:
    """The trajectory in a file, whose format is found by its first lines."""
    text = read_text(path, "the odometry")
    if _is_euroc(text.lstrip().partition("\n")[0]):
        return read_euroc(path, text)
    row, cells = next(rows(path, None), (1, []))
    if len(cells) in (8, 12) and "," not in "".join(cells):
        return read_tum(path) if len(cells) == 8 else read_kitti(path)
    if path.suffix.lower() != ".csv" and "," not in "".join(cells):
        raise mismatch(f"{path}, row {row}", FORMATS, f"{len(cells)} values")
    return read_csv(path)


def read_csv(path: Path) -> Trajectory:
    """``time`` and ``x,y[,z]``, ``distance`` or both; a ``yaw`` in radians is the heading."""
    header = [name.lower() for name in header_and_rows(path, COLUMNS)[0]]
    named = [match for match in map(TIME.fullmatch, header) if match]
    # Of several, the one that the documentation names.
    named.sort(key=lambda match: match[0] != "time")
    clock = named[0][0] if named else "time"
    choices = tuple((clock, *names[1:]) for names in CHOICES)
    _, values, numbers, cells_of = columns(path, choices, COLUMNS)
    unit = UNITS.get(named[0][2] or "") if named else None
    seconds, remarks = in_seconds(values[:, 0], unit, clock)
    times, positions = _ascending(seconds, numbers, path), values[:, 1:]

    def more(name: str) -> Float64 | None:
        cells = cells_of(name)
        if cells is None:
            return None
        return np.array([decimal(c, path, n, name) for c, n in zip(cells, numbers, strict=True)])

    along, yaw = more("distance"), more("yaw")
    if along is None and yaw is not None:
        o = np.zeros_like(yaw)
        along = driven(positions, rotations(np.stack([o, o, np.sin(yaw / 2), np.cos(yaw / 2)], 1)))
    return Trajectory(times, positions, along, remarks=remarks)


def read_tum(path: Path) -> Trajectory:
    """``timestamp tx ty tz qx qy qz qw``, in seconds and metres; ORB-SLAM3 writes nanoseconds."""
    numbers, values = _numbers(path, TUM, " ".join(TUM))
    seconds, remarks = in_seconds(values[:, 0], None, TUM[0])
    times = _ascending(seconds, numbers, path)
    along = _along(values[:, 1:4], values[:, 4:], numbers, path)
    return Trajectory(times, values[:, 1:4], along, remarks=remarks)


def in_seconds(times: Float64, unit: float | None, name: str) -> tuple[Float64, tuple[str, ...]]:
    """Times in seconds: by the ``unit`` that their column names, in parts of a second, or, if they
    could be no seconds since 1970, by their size; and a remark if they are in another unit.
    """
    units = {factor: word for _, factor, word in EPOCH}
    if unit is None:
        size = float(np.abs(times).max(initial=0.0))
        unit = next((factor for above, factor, _ in EPOCH if size > above), 1.0)
    if unit == 1:
        return times, ()
    return times / unit, (f"{name} in {units[unit]}",)


def read_kitti(path: Path) -> Trajectory:
    """A pose a frame, 12 numbers: its times are those of a ``times.txt`` beside it, or of KITTI's
    ``sequences/00/times.txt`` for ``poses/00.txt``, if there is one.
    """
    numbers, values = _numbers(path, ("",) * 12, KITTI)
    poses = values.reshape(-1, 3, 4)
    turns, positions = poses[:, :, :3], poses[:, :, 3]
    skewed = np.abs(turns @ turns.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2)) > 0.01
    if skewed.any():
        row = int(np.argmax(skewed))
        got = turns[row].tolist()
        raise mismatch(f"{path}, row {numbers[row]}", "a rotation in the columns but the last", got)
    times: Float64 | None = None
    sequence = path.parent.parent / "sequences" / path.stem
    for file in (path.with_name("times.txt"), sequence / "times.txt"):
        if file.is_file():
            rows_of, stamps = _numbers(file, ("time",), "seconds")
            if len(stamps) != len(poses):
                expected = f"a time for each of the {len(poses)} poses in {path}"
                raise mismatch(file, expected, len(stamps))
            times = _ascending(stamps[:, 0], rows_of, file)
            break
    return Trajectory(times, positions, driven(positions, turns), by_frame=True)


def read_euroc(path: Path, text: str) -> Trajectory:
    """``#timestamp, p_RS_R_x [m], ..., q_RS_w [], ...``: a comma between, times in nanoseconds;
    further columns are passed over, and the quaternion may be missing.
    """
    first = text.lstrip().partition("\n")[0]
    names = [cell.split("[")[0].strip("# ").lower() for cell in first.split(",")]
    ends = [name.rpartition("_")[2] for name in names[1:8]]
    if tuple(ends[:3]) != EUROC[:3] or "[" in first.split(",")[0].replace("[ns]", ""):
        expected = "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], ..."
        raise mismatch(f"{path}, row 1", expected, first)
    count = 7 if tuple(ends) == EUROC else 3
    stamps, numbers, values = [], [], []
    # Without the # it is a row.
    for number, cells in islice(rows(path, ","), int(not first.startswith("#")), None):
        if len(cells) != len(names):
            raise mismatch(f"{path}, row {number}", f"{len(names)} values", len(cells))
        stamps.append(whole(cells[0], path, number, "timestamp in nanoseconds"))
        pose = zip(cells[1 : count + 1], names[1:], strict=False)
        values.append([decimal(cell, path, number, name) for cell, name in pose])
        numbers.append(number)
    if not stamps:
        raise mismatch(path, "poses", "none")
    times = _ascending(np.array(stamps) / 1e9, numbers, path)
    poses = np.array(values)
    turned = poses[:, [4, 5, 6, 3]] if count == 7 else None
    along = None if turned is None else _along(poses[:, :3], turned, numbers, path)
    return Trajectory(times, poses[:, :3], along)


def along_of(positions: Float64, quaternions: Float64) -> tuple[Float64 | None, int | None]:
    """The distance driven (``driven``), None if no orientation is set; and the first row whose
    quaternion (x, y, z, w) is not of unit length, None if there is none.
    """
    lengths = np.linalg.norm(quaternions, axis=1)
    if not lengths.any():
        return None, None
    wrong = ~(np.abs(lengths - 1) <= 0.01)
    if wrong.any():
        return None, int(np.argmax(wrong))
    return driven(positions, rotations(quaternions / lengths[:, None])), None


def _along(
    positions: Float64, quaternions: Float64, numbers: Sequence[int], path: Path
) -> Float64 | None:
    along, wrong = along_of(positions, quaternions)
    if wrong is not None:
        got = f"{quaternions[wrong].tolist()} (x, y, z, w)"
        raise mismatch(f"{path}, row {numbers[wrong]}", "a quaternion of unit length", got)
    return along


def _is_euroc(first: str) -> bool:
    header = first.lstrip("# ").lower()
    return header.startswith("timestamp") and "p_rs_r_x" in header


def _numbers(path: Path, names: Sequence[str], what: str) -> tuple[list[int], Float64]:
    """The number of each row, and its values, one for each name."""
    numbers, values = [], []
    for number, cells in rows(path, None, "the odometry"):
        if len(cells) != len(names):
            raise mismatch(f"{path}, row {number}", f"{len(names)} values ({what})", len(cells))
        named = zip(cells, names, strict=True)
        values.append([decimal(cell, path, number, name or what) for cell, name in named])
        numbers.append(number)
    if not numbers:
        raise mismatch(path, f"rows of {what}", "none")
    return numbers, np.array(values)


def _ascending(times: Float64, numbers: Sequence[int], path: Path) -> Float64:
    late = np.flatnonzero(np.diff(times) <= 0)
    if len(late):
        row = int(late[0]) + 1
        got = f"{times[row]} after {times[row - 1]}"
        raise mismatch(f"{path}, row {numbers[row]}", "ascending times", got)
    return times
