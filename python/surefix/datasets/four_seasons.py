"""4Seasons: drives around Munich in all weathers, with positions by stereo and RTK-GNSS."""

from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from surefix.datasets.pair import Origin, Pair
from surefix.datasets.tracks import (
    Drive,
    Placing,
    Track,
    choose_traverses,
    named_folders,
    read_stamps,
)
from surefix.errors import mismatch
from surefix.frames.images import ImageFiles
from surefix.tables.poses import rotations
from surefix.tables.rows import ascending, decimal, read_text, rows, whole

FOLDERS = "recording_*"
# From the local plane (east, north, up) to the Earth-centred frame.
EARTH = "transform_e_gpsw"
FOUR_SEASONS = Origin(
    "4Seasons",
    "https://www.4seasons-dataset.com (P. Wenzel et al., TU Munich and Artisense)",
    "stated on that page; not established by surefix",
    signs=(FOLDERS,),
)
OFFICE_LOOP = (
    "recording_2020-03-24_17-36-22",
    "recording_2020-03-24_17-45-31",
    "recording_2020-04-07_10-20-32",
    "recording_2020-06-12_10-10-57",
    "recording_2021-01-07_12-04-03",
    "recording_2021-02-25_13-51-57",
)


def four_seasons(
    root: str | PathLike[str],
    *,
    reference: str | None = None,
    query: str | None = None,
    images: str = "undistorted_images/cam0",
    poses: str = "GNSSPoses.txt",
    spacing: float | None = 1.0,
    tolerance: float = 10.0,
    longest_gap: float = 2.0,
    incomplete: Literal["drop", "error"] = "drop",
) -> Pair:
    """Two recordings of one 4Seasons route, paired by position. ``OFFICE_LOOP`` lists those of the
    office loop.

    Layout, in each ``root/recording_2020-03-24_17-36-22/``::

        times.txt             frame_id timestamp exposure
        GNSSPoses.txt         frame_id,t_x,t_y,t_z,q_x,q_y,q_z,w,scale,...
        Transformations.txt   transform_S_AS, transform_w_gpsw, transform_e_gpsw
        undistorted_images/cam0/<frame_id>.png

    ``frame_id`` is the time in nanoseconds. Poses are of key frames, in a frame of the recording's
    own; each is taken to the Earth as the publisher says, ``e_gpsw inv(w_gpsw) S_AS scale``, and
    from there to the plane of the reference recording's ``transform_e_gpsw``: metres east and
    north, for both recordings. Images between two key frames get the linear interpolation; those
    before the first, after the last, or in a longer gap (a standstill may have no key frames) have
    no position. Spacing and tolerance are our choice: the paper's own could not be established.

    Parameters
    ----------
    root : str or path
    reference, query : str, optional
        The recordings' folders; by default the only two that exist, the older as the reference.
    images, poses : str
        The images and the poses of a recording: the archives can be unpacked in several ways.
    spacing : float or None
        Keep an image every this many metres; None keeps all, thirty a second.
    tolerance : float
        The true place of a query is the nearest reference within these metres; -1 for none.
    longest_gap : float
        In seconds: key frames further apart give no position between them.
    incomplete : {"drop", "error"}
        Leave an image without a file or a position out and say so in ``notes``, or raise.

    Raises
    ------
    SurefixFileError
        For a folder or file that is missing.
    SurefixValueError
        For a malformed row, timestamps that do not ascend, or no image with a position.
    """
    folders = choose_traverses(FOUR_SEASONS, Path(root), "recording", reference, query)
    plane = _transform(folders[0], EARTH)
    placing = Placing(FOUR_SEASONS, 1_000_000_000, spacing, longest_gap, incomplete)
    drives = [_drive(folder, images, poses, plane) for folder in folders]
    names = [folder.name.removeprefix("recording_") for folder in folders]
    return placing.pair(f"4Seasons {names[0]} / {names[1]}", drives, ImageFiles, tolerance)


def recordings(root: Path) -> list[str]:
    """The recordings that exist, the oldest first."""
    return named_folders(root, FOLDERS)


def _drive(folder: Path, images: str, poses: str, plane: npt.NDArray[np.float64]) -> Drive:
    times = FOUR_SEASONS.file(folder / "times.txt", "the time of each image")
    camera = FOUR_SEASONS.folder(folder / images, "the images of the camera")
    stamps = read_stamps(times, "frame_id timestamp exposure", "frame_id, nanoseconds")
    return Drive(camera, stamps, times, _track(folder, poses, plane))


def _track(folder: Path, poses: str, plane: npt.NDArray[np.float64]) -> Track:
    """The key frames, in metres east and north on the plane."""
    path = FOUR_SEASONS.file(folder / poses, "the positions of the key frames")
    stamps, numbers, scaled = [], [], []
    for row, cells in rows(path, ","):
        if len(cells) < 9:
            columns = "frame_id,t_x,t_y,t_z,q_x,q_y,q_z,w,scale"
            raise mismatch(f"{path}, row {row}", f"at least 9 values ({columns})", len(cells))
        what = "a pose and its scale"
        pose = [decimal(cell, path, row, what, finite=False) for cell in cells[1:9]]
        stamp = whole(cells[0], path, row, "frame_id, nanoseconds")
        if np.isfinite(pose).all():  # the publisher marks a key frame without a pose by NaN
            stamps.append(stamp)
            numbers.append(row)
            scaled.append(np.array(pose[:3]) * pose[7])
    if not stamps:
        raise mismatch(path, "a pose a line", "none")
    world = np.linalg.inv(_transform(folder, "transform_w_gpsw"))
    to_earth = _transform(folder, EARTH) @ world @ _transform(folder, "transform_S_AS")
    to_plane = np.linalg.inv(plane) @ to_earth
    metres = np.array(scaled) @ to_plane[:3, :3].T + to_plane[:3, 3]
    return Track(path, ascending(stamps, numbers, path), metres[:, :2])


def _transform(folder: Path, name: str) -> npt.NDArray[np.float64]:
    """A transform of a recording, 4 x 4, by name; there may be empty lines between them."""
    path = FOUR_SEASONS.file(folder / "Transformations.txt", "the frames that the poses are in")
    lines = list(enumerate(read_text(path, "the transformations").splitlines(), start=1))
    heads = [line.strip() for _, line in lines if line.lstrip().startswith("#")]
    at = next((row for row, line in lines if line.lstrip("# ").startswith(f"{name}:")), None)
    if at is None:
        raise mismatch(path, f"a line '# {name}: ...'", ", ".join(heads) or "no such line")
    row, text = next(((row, line) for row, line in lines[at:] if line.strip()), (at + 1, ""))
    cells = text.split(",")
    if len(cells) != 7:
        expected = f"7 values of {name} (x,y,z,q_x,q_y,q_z,w)"
        raise mismatch(f"{path}, row {row}", expected, len(cells))
    values = [decimal(cell.strip(), path, row, name) for cell in cells]
    norm = float(np.linalg.norm(values[3:]))
    if abs(norm - 1) > 1e-3:
        raise mismatch(f"{path}, row {row}", f"a unit quaternion of {name}", f"norm {norm}")
    matrix = np.eye(4)
    matrix[:3, :3] = rotations([np.array(values[3:]) / norm])[0]
    matrix[:3, 3] = values[:3]
    return matrix
