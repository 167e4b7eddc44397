"""4Seasons: drives around Munich in all weathers, with positions fused of stereo odometry and
RTK-GNSS.
"""

from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from surefix.datasets.images import ImageFiles
from surefix.datasets.origin import Origin
from surefix.datasets.pair import Pair
from surefix.datasets.positions import pair_by_position
from surefix.datasets.rows import ascending, decimal, rows, whole
from surefix.datasets.traverse import Placed, Track, choose_traverses, named_folders, place_images
from surefix.errors import SurefixFileError, SurefixValueError

__all__ = ["FOUR_SEASONS", "OFFICE_LOOP", "four_seasons", "recordings"]

FOUR_SEASONS = Origin(
    "4Seasons",
    "https://www.4seasons-dataset.com (P. Wenzel et al., Technical University of Munich and Artisense)",
    "stated on that page; not established by surefix",
)
OFFICE_LOOP = (
    "recording_2020-03-24_17-36-22",
    "recording_2020-03-24_17-45-31",
    "recording_2020-04-07_10-20-32",
    "recording_2020-06-12_10-10-57",
    "recording_2021-01-07_12-04-03",
    "recording_2021-02-25_13-51-57",
)
_FOLDERS = "recording_*"
_NANOSECONDS = 1_000_000_000


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

    Layout::

        root/recording_2020-03-24_17-36-22/times.txt             frame_id timestamp exposure
        root/recording_2020-03-24_17-36-22/GNSSPoses.txt
        frame_id,t_x,t_y,t_z,q_x,q_y,q_z,w,scale,...
        root/recording_2020-03-24_17-36-22/Transformations.txt   transform_S_AS, transform_w_gpsw,
        transform_e_gpsw root/recording_2020-03-24_17-36-22/undistorted_images/cam0/<frame_id>.png

    ``frame_id`` is the time in nanoseconds. Poses are of key frames, in a frame of the recording's
    own; each is taken to the Earth as the publisher says, ``e_gpsw inv(w_gpsw) S_AS scale``, and
    from there to the plane of the reference recording's ``transform_e_gpsw``: metres east and
    north, for both recordings. Images between two key frames get the linear interpolation; those
    before the first, after the last, or in a longer gap (a standstill may have no key frames) have
    no position. Spacing and tolerance are our choice: the paper's own could not be established.

    Parameters ---------- root : str or path reference, query : str, optional The recordings'
    folders; by default the only two that are there, the older as the reference. images, poses : str
    Where in a recording the images and the poses are: the archives can be unpacked in more than one
    way. spacing : float or None Keep an image every so many metres; None keeps all, thirty a
    second. tolerance : float The true place of a query is the nearest reference within so many
    metres; -1 where there is none. longest_gap : float In seconds: key frames further apart give no
    position between them. incomplete : {"drop", "error"} What to do with an image without a file or
    a position: leave it out and say so in ``notes``, or raise.

    Raises
    ------
    SurefixFileError
        For a folder or file that is not there.
    SurefixValueError
        For a malformed row, timestamps that do not ascend, or no image with a position.
    """
    folders = choose_traverses(FOUR_SEASONS, Path(root), _FOLDERS, "recording", reference, query)
    plane = _Transformations(folders[0]).earth
    first, second = (
        _recording(folder, images, poses, plane, spacing, longest_gap, incomplete)
        for folder in folders
    )
    return Pair(
        f"4Seasons {folders[0].name.removeprefix('recording_')} / {folders[1].name.removeprefix('recording_')}",
        ImageFiles(first.files),
        ImageFiles(second.files),
        pair_by_position(first.positions, second.positions, tolerance),
        first.positions,
        second.positions,
        FOUR_SEASONS.source,
        FOUR_SEASONS.licence,
        first.notes + second.notes,
    )


def recordings(root: Path) -> list[str]:
    """The recordings that are there, the oldest first."""
    return named_folders(root, _FOLDERS)


def _recording(
    folder: Path,
    images: str,
    poses: str,
    plane: npt.NDArray[np.float64],
    spacing: float | None,
    longest_gap: float,
    incomplete: Literal["drop", "error"],
) -> Placed:
    times = FOUR_SEASONS.file(folder / "times.txt", "the time of each image")
    camera = FOUR_SEASONS.folder(folder / images, "the images of the camera")
    numbered = [
        (row, whole(cells[0], times, row, "frame_id, nanoseconds"))
        for row, cells in rows(times, None)
    ]
    if not numbered:
        raise SurefixValueError(f"{times}: expected lines of frame_id timestamp exposure, got none")
    stamps = ascending([stamp for _, stamp in numbered], [row for row, _ in numbered], times)
    return place_images(
        [camera / f"{stamp}.png" for stamp in stamps],
        stamps,
        _track(folder, poses, plane),
        origin=FOUR_SEASONS,
        listed_in=times,
        ticks_a_second=_NANOSECONDS,
        longest_gap=longest_gap,
        spacing=spacing,
        incomplete=incomplete,
    )


def _track(folder: Path, poses: str, plane: npt.NDArray[np.float64]) -> Track:
    """Where the key frames are, in metres east and north on the plane."""
    path = FOUR_SEASONS.file(folder / poses, "the positions of the key frames")
    stamps, numbers, scaled = [], [], []
    for row, cells in rows(path, ","):
        if len(cells) < 9:
            columns = "frame_id,t_x,t_y,t_z,q_x,q_y,q_z,w,scale"
            raise SurefixValueError(
                f"{path}, row {row}: expected at least 9 values ({columns}), got {len(cells)}"
            )
        pose = [
            decimal(cell, path, row, "a pose and its scale", finite=False) for cell in cells[1:9]
        ]
        stamp = whole(cells[0], path, row, "frame_id, nanoseconds")
        if np.isfinite(pose).all():  # the publisher marks a key frame without a pose by NaN
            stamps.append(stamp)
            numbers.append(row)
            scaled.append(np.array(pose[:3]) * pose[7])
    if not stamps:
        raise SurefixValueError(f"{path}: expected a pose a line, got none")
    to_earth = _Transformations(folder).slam_to_earth
    to_plane = np.linalg.inv(plane) @ to_earth
    metres = np.array(scaled) @ to_plane[:3, :3].T + to_plane[:3, 3]
    return Track(path, ascending(stamps, numbers, path), metres[:, :2])


class _Transformations:
    """The transforms of a recording, 4 x 4, found by name: some files have empty lines between
    them, some do not.
    """

    def __init__(self, folder: Path) -> None:
        self.path = FOUR_SEASONS.file(
            folder / "Transformations.txt", "the frames that the poses are in"
        )
        try:
            self.lines = self.path.read_text(encoding="utf-8-sig").splitlines()
        except OSError as error:
            raise SurefixFileError(f"{self.path}: cannot read: {error.strerror or error}") from None
        except UnicodeDecodeError as error:
            raise SurefixValueError(
                f"{self.path}: expected a text file in UTF-8, got {error.reason}"
            ) from None

    @property
    def earth(self) -> npt.NDArray[np.float64]:
        """From the local plane (east, north, up) to the Earth-centred frame."""
        return self._matrix("transform_e_gpsw")

    @property
    def slam_to_earth(self) -> npt.NDArray[np.float64]:
        """From the scaled poses to the Earth-centred frame."""
        return (
            self.earth
            @ np.linalg.inv(self._matrix("transform_w_gpsw"))
            @ self._matrix("transform_S_AS")
        )

    def _matrix(self, name: str) -> npt.NDArray[np.float64]:
        for row, line in enumerate(self.lines, start=1):
            if line.lstrip("# ").startswith(f"{name}:"):
                after = [
                    (at, text)
                    for at, text in enumerate(self.lines[row:], start=row + 1)
                    if text.strip()
                ]
                number, text = after[0] if after else (row + 1, "")
                break
        else:
            heads = (
                ", ".join(line.strip() for line in self.lines if line.lstrip().startswith("#"))
                or "no such line"
            )
            raise SurefixValueError(f"{self.path}: expected a line '# {name}: ...', got {heads}")
        cells = text.split(",")
        if len(cells) != 7:
            raise SurefixValueError(
                f"{self.path}, row {number}: expected 7 values of {name} (x,y,z,q_x,q_y,q_z,w), got {len(cells)}"
            )
        values = [decimal(cell.strip(), self.path, number, name) for cell in cells]
        norm = float(np.linalg.norm(values[3:]))
        if abs(norm - 1) > 1e-3:
            raise SurefixValueError(
                f"{self.path}, row {number}: expected a unit quaternion of {name}, got norm {norm}"
            )
        matrix = np.eye(4)
        matrix[:3, :3] = _rotation(np.array(values[3:]) / norm)
        matrix[:3, 3] = values[:3]
        return matrix


def _rotation(quaternion: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """The matrix of a unit quaternion (x, y, z, w): I + 2 w [v] + 2 [v] [v]."""
    x, y, z, w = quaternion
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + 2 * w * cross + 2 * cross @ cross, dtype=np.float64)
