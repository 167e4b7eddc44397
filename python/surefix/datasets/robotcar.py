"""Oxford RobotCar: one route through Oxford, driven over a hundred times in a year."""

from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np

from surefix.datasets.bayer import Method, Pattern
from surefix.datasets.images import BayerFiles
from surefix.datasets.origin import Origin
from surefix.datasets.pair import Pair
from surefix.datasets.positions import pair_by_position
from surefix.datasets.rows import ascending, decimal, header_and_rows, rows, whole
from surefix.datasets.traverse import Placed, Track, choose_traverses, named_folders, place_images
from surefix.errors import SurefixValueError

__all__ = ["ROBOTCAR", "drives", "robotcar"]

ROBOTCAR = Origin(
    "Oxford RobotCar",
    "https://robotcar-dataset.robots.ox.ac.uk (W. Maddern, G. Pascoe, C. Linegar, P. Newman; registration needed)",
    "CC BY-NC-SA 4.0, for non-commercial academic use",
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
_FOLDERS = "20??-??-??-??-??-??*"
_MICROSECONDS = 1_000_000


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
    demosaic: Method = "superpixel",
    incomplete: Literal["drop", "error"] = "drop",
) -> Pair:
    """Two traverses of Oxford RobotCar, paired by position.

    Layout, all archives of a traverse unpacked into one place::

        root/2014-12-09-13-21-02/stereo.timestamps               timestamp chunk
        root/2014-12-09-13-21-02/stereo/centre/<timestamp>.png   raw Bayer mosaic, GBRG, 1280 x 960
        root/2014-12-09-13-21-02/gps/ins.csv                     timestamp, northing, easting,
        utm_zone, ... by name

    Timestamps are in microseconds. Positions are the file's own UTM ``easting`` and ``northing``,
    in metres, linear between the two rows around an image's time. ``ins_status`` is not looked at.
    The images are demosaiced when they are read, and not rectified. The timestamps list the whole
    drive: images of chunks that were not downloaded are left out. Spacing and tolerance are our
    choice: the paper's own could not be established.

    Parameters ---------- root : str or path reference, query : str, optional The traverses'
    folders; by default the only two that are there, the older as the reference. camera :
    {"stereo/centre", "stereo/left", "stereo/right", "mono_left", "mono_right", "mono_rear"} The
    monocular cameras have RGGB mosaics, and timestamps of their own. positions : str ``"ins"``:
    ``gps/ins.csv``. ``"rtk"``: ``gps/rtk.csv``, the ground truth of 2020, put there by hand: where
    it is in its archive could not be established. Or another path relative to the traverse. spacing
    : float or None Keep an image every so many metres; None keeps all, sixteen a second. tolerance
    : float The true place of a query is the nearest reference within so many metres; -1 where there
    is none. The INS of two traverses can differ by several metres. longest_gap : float In seconds:
    rows further apart give no position between them. demosaic : {"superpixel", "bilinear"} As in
    ``surefix.datasets.demosaic``. ``superpixel`` halves the sides, ``bilinear`` keeps them.
    incomplete : {"drop", "error"} What to do with an image without a file or a position: leave it
    out and say so in ``notes``, or raise.

    Raises ------ SurefixFileError For a folder or file that is not there. SurefixValueError For a
    malformed row, timestamps that do not ascend, two UTM zones, or no image with a position.
    """
    if camera not in CAMERAS:
        raise SurefixValueError(f"camera: expected one of {', '.join(CAMERAS)}, got {camera!r}")
    if demosaic not in ("superpixel", "bilinear"):
        raise SurefixValueError(f"demosaic: expected one of superpixel, bilinear, got {demosaic!r}")
    folders = choose_traverses(ROBOTCAR, Path(root), _FOLDERS, "traverse", reference, query)
    tracks = [_track(folder, _POSITION_FILES.get(positions, positions)) for folder in folders]
    zones = [zone for _, zone in tracks]
    if None not in zones and zones[0] != zones[1]:
        file = tracks[1][0].path
        raise SurefixValueError(
            f"{file}: expected the UTM zone of the reference, {zones[0]}, got {zones[1]}"
        )
    first, second = (
        _traverse(folder, camera, track, spacing, longest_gap, incomplete)
        for folder, (track, _) in zip(folders, tracks, strict=True)
    )
    return Pair(
        f"RobotCar {folders[0].name} / {folders[1].name}",
        BayerFiles(first.files, CAMERAS[camera], demosaic),
        BayerFiles(second.files, CAMERAS[camera], demosaic),
        pair_by_position(first.positions, second.positions, tolerance),
        first.positions,
        second.positions,
        ROBOTCAR.source,
        ROBOTCAR.licence,
        first.notes + second.notes,
    )


def drives(root: Path) -> list[str]:
    """The traverses that are there, the oldest first."""
    return named_folders(root, _FOLDERS)


def _traverse(
    folder: Path,
    camera: str,
    track: Track,
    spacing: float | None,
    longest_gap: float,
    incomplete: Literal["drop", "error"],
) -> Placed:
    listing = ROBOTCAR.file(folder / f"{camera.split('/')[0]}.timestamps", "the time of each image")
    images = ROBOTCAR.folder(folder / camera, "the images of the camera")
    stamps, numbers = [], []
    for row, cells in rows(listing, None):
        if len(cells) != 2:
            raise SurefixValueError(
                f"{listing}, row {row}: expected 2 values (timestamp chunk), got {len(cells)}"
            )
        stamps.append(whole(cells[0], listing, row, "a timestamp in microseconds"))
        numbers.append(row)
    if not stamps:
        raise SurefixValueError(f"{listing}: expected lines of timestamp chunk, got none")
    times = ascending(stamps, numbers, listing)
    return place_images(
        [images / f"{stamp}.png" for stamp in times],
        times,
        track,
        origin=ROBOTCAR,
        listed_in=listing,
        ticks_a_second=_MICROSECONDS,
        longest_gap=longest_gap,
        spacing=spacing,
        incomplete=incomplete,
    )


def _track(folder: Path, file: str) -> tuple[Track, str | None]:
    """The track, and the UTM zone it is in, where the file says."""
    path = ROBOTCAR.file(folder / file, "the position at each time")
    wanted = ("timestamp", "easting", "northing")
    header, numbered = header_and_rows(path, "timestamp,...,northing,easting,...")
    if not set(wanted) <= set(header):
        raise SurefixValueError(
            f"{path}, row 1: expected the columns {', '.join(wanted)}, got {','.join(header)}"
        )
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
        raise SurefixValueError(
            f"{path}, row {max(zones.values())}: expected one UTM zone, got {' and '.join(zones)}"
        )
    track = Track(
        path,
        ascending(stamps, [row for row, _ in numbered], path),
        np.array(metres, dtype=np.float64),
    )
    return track, next(iter(zones), None)
