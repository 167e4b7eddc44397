"""Oxford RobotCar: one route through Oxford, driven over a hundred times in a year."""

from functools import partial
from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np

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
from surefix.frames.bayer import Pattern
from surefix.frames.images import BayerFiles
from surefix.tables.rows import ascending, decimal, header_and_rows, whole

FOLDERS = "20??-??-??-??-??-??*"
ROBOTCAR = Origin(
    "Oxford RobotCar",
    "https://robotcar-dataset.robots.ox.ac.uk (W. Maddern, G. Pascoe, C. Linegar, P. Newman; "
    "registration needed)",
    "CC BY-NC-SA 4.0, for non-commercial academic use",
    signs=(FOLDERS,),
)
CAMERAS: dict[str, Pattern] = {
    "stereo/centre": "gbrg",
    "stereo/left": "gbrg",
    "stereo/right": "gbrg",
    "mono_left": "rggb",
    "mono_right": "rggb",
    "mono_rear": "rggb",
}
_POSITION_FILES = {"ins": "gps/ins.csv", "rtk": "gps/rtk.csv"}


def robotcar(
    root: str | PathLike[str],
    *,
    reference: str | None = None,
    query: str | None = None,
    camera: str = "stereo/centre",
    positions: str = "ins",
    spacing: float | None = 1.0,
    tolerance: float = 10.0,
    longest_gap: float = 1.0,
    incomplete: Literal["drop", "error"] = "drop",
) -> Pair:
    """Two traverses of Oxford RobotCar, paired by position.

    Layout, with all archives of a traverse unpacked into ``root/2014-12-09-13-21-02/``::

        stereo.timestamps               timestamp chunk
        stereo/centre/<timestamp>.png   raw Bayer mosaic, GBRG, 1280 x 960
        gps/ins.csv                     timestamp, northing, easting, utm_zone, ... by name

    Timestamps are in microseconds. Positions are the file's own UTM ``easting`` and ``northing``,
    in metres, linear between the two rows around an image's time. ``ins_status`` is ignored. The
    images are demosaiced to half their sides when they are read, and not rectified. The timestamps
    list the whole drive: images of chunks that were not downloaded are left out. Spacing and
    tolerance are our choice: the paper's own could not be established.

    Parameters
    ----------
    root : str or path
    reference, query : str, optional
        The traverses' folders; by default the only two that exist, the older as the reference.
    camera : str
        "stereo/centre", "stereo/left" or "stereo/right"; or "mono_left", "mono_right" or
        "mono_rear", with RGGB mosaics and timestamps of their own.
    positions : str
        ``"ins"``: ``gps/ins.csv``. ``"rtk"``: ``gps/rtk.csv``, the ground truth of 2020, put there
        by hand: its place in its archive could not be established. Or another path relative to the
        traverse.
    spacing : float or None
        Keep an image every this many metres; None keeps all, sixteen a second.
    tolerance : float
        The true place of a query is the nearest reference within these metres; -1 for none. The
        INS of two traverses can differ by several metres.
    longest_gap : float
        In seconds: rows further apart give no position between them.
    incomplete : {"drop", "error"}
        Leave an image without a file or a position out and say so in ``notes``, or raise.

    Raises
    ------
    SurefixFileError
        For a folder or file that is missing.
    SurefixValueError
        For a malformed row, timestamps that do not ascend, two UTM zones, or no image with a
        position.
    """
    if camera not in CAMERAS:
        raise mismatch("camera", f"one of {', '.join(CAMERAS)}", repr(camera))
    placing = Placing(ROBOTCAR, 1_000_000, spacing, longest_gap, incomplete)
    folders = choose_traverses(ROBOTCAR, Path(root), "traverse", reference, query)
    tracks = [_track(folder, _POSITION_FILES.get(positions, positions)) for folder in folders]
    zones = [zone for _, zone in tracks]
    if None not in zones and zones[0] != zones[1]:
        file = tracks[1][0].path
        raise mismatch(file, f"the UTM zone of the reference, {zones[0]}", zones[1])
    pairs = zip(folders, tracks, strict=True)
    both = [_drive(folder, camera, track) for folder, (track, _) in pairs]
    title = f"RobotCar {folders[0].name} / {folders[1].name}"
    images = partial(BayerFiles, pattern=CAMERAS[camera])
    return placing.pair(title, both, images, tolerance)


def drives(root: Path) -> list[str]:
    """The traverses that exist, the oldest first."""
    return named_folders(root, FOLDERS)


def _drive(folder: Path, camera: str, track: Track) -> Drive:
    listing = ROBOTCAR.file(folder / f"{camera.split('/')[0]}.timestamps", "the time of each image")
    images = ROBOTCAR.folder(folder / camera, "the images of the camera")
    times = read_stamps(listing, "timestamp chunk", "a timestamp in microseconds", columns=2)
    return Drive(images, times, listing, track)


def _track(folder: Path, file: str) -> tuple[Track, str | None]:
    """The track, and its UTM zone if the file has one."""
    path = ROBOTCAR.file(folder / file, "the position at each time")
    wanted = ("timestamp", "easting", "northing")
    header, numbered = header_and_rows(path, "timestamp,...,northing,easting,...")
    if not set(wanted) <= set(header):
        raise mismatch(f"{path}, row 1", f"the columns {', '.join(wanted)}", ",".join(header))
    time, east, north = (header.index(column) for column in wanted)
    zone = header.index("utm_zone") if "utm_zone" in header else None
    stamps, metres = [], []
    zones: dict[str, int] = {}
    for row, cells in numbered:
        stamps.append(whole(cells[time], path, row, "a timestamp in microseconds"))
        metres.append([decimal(cells[i], path, row, "metres") for i in (east, north)])
        if zone is not None:
            zones.setdefault(cells[zone], row)
    if len(zones) > 1:
        raise mismatch(f"{path}, row {max(zones.values())}", "one UTM zone", " and ".join(zones))
    times = ascending(stamps, [row for row, _ in numbered], path)
    return Track(path, times, np.array(metres, dtype=np.float64)), next(iter(zones), None)
