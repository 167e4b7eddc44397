"""Images and a track, each with its own times: images with positions, one every few metres."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from surefix.datasets.pair import Origin, Pair
from surefix.errors import SurefixFileError, SurefixValueError, mismatch
from surefix.frames.images import Images
from surefix.tables.metres import interpolate, pair_by_position, subsample


@dataclass(frozen=True)
class Placing:
    """The options of ``place_images``: metres between images; the longest gap of a track, in
    seconds; and what to do with an image without a file or a position.
    """

    spacing: float | None
    longest_gap: float
    incomplete: Literal["drop", "error"]

    def __post_init__(self) -> None:
        if self.incomplete not in ("drop", "error"):
            raise mismatch("incomplete", "'drop' or 'error'", repr(self.incomplete))
        if not self.longest_gap > 0:
            raise mismatch("longest_gap", "seconds, more than 0", self.longest_gap)
        if self.spacing is not None and not (np.isfinite(self.spacing) and self.spacing > 0):
            raise mismatch("spacing", "metres, more than 0, or None for every image", self.spacing)


@dataclass(frozen=True)
class Track:
    """The positions of a vehicle, (n, d) in metres, at ascending ``stamps`` (n,)."""

    path: Path
    stamps: npt.NDArray[np.int64]
    positions: npt.NDArray[np.float64]


@dataclass(frozen=True)
class Placed:
    """The images that are kept, in the order of their times, and the position of each."""

    files: list[Path]
    positions: npt.NDArray[np.float64]
    notes: tuple[str, ...]


def place_images(
    files: Sequence[Path],
    stamps: npt.NDArray[np.int64],
    track: Track,
    placing: Placing,
    *,
    origin: Origin,
    listed_in: Path,
    ticks_a_second: int,
) -> Placed:
    """Gives each image the position of its time, and keeps one every ``spacing`` metres.

    An image without a file or a position is left out and counted in the notes, or an error.
    """
    try:
        present = {
            path.name for folder in {file.parent for file in files} for path in folder.iterdir()
        }
    except OSError as error:
        raise SurefixFileError(
            f"{error.filename}: cannot list the images: {error.strerror}"
        ) from None
    on_disk = np.array([file.name in present for file in files], dtype=np.bool_)
    gap = int(min(placing.longest_gap * ticks_a_second, 2.0**62))
    positions, known = interpolate(stamps, track.stamps, track.positions, gap)
    notes = []
    if not on_disk.all():
        first = files[int(np.argmin(on_disk))]
        missing = f"{int((~on_disk).sum())} of the {len(files)} images"
        counted = f"{missing} that {listed_in} lists are not there"
        if placing.incomplete == "error" or not on_disk.any():
            raise origin.missing(first, "no such image", counted)
        notes.append(f"Left out: {counted}, the first is {first.name}")
    placeless = on_disk & ~known
    if placeless.any():
        first = files[int(np.argmax(placeless))]
        missing = f"{int(placeless.sum())} of the {int(on_disk.sum())} images"
        counted = f"{missing} in {first.parent} have no position"
        where = f"in {track.path} around their time, the first is {first.name}"
        if placing.incomplete == "error" or not known[on_disk].any():
            raise SurefixValueError(f"{counted} {where}")
        notes.append(f"Left out: {counted} {where}")
    kept = np.flatnonzero(on_disk & known)
    if placing.spacing is not None:
        kept = kept[subsample(positions[kept], placing.spacing)]
    return Placed([files[i] for i in kept.tolist()], positions[kept], tuple(notes))


def pair_of(
    name: str,
    origin: Origin,
    images: Sequence[Images],
    first: Placed,
    second: Placed,
    tolerance: float,
) -> Pair:
    """Two traverses paired by position: the truth is the nearest reference within ``tolerance``."""
    return Pair(
        name,
        images[0],
        images[1],
        pair_by_position(first.positions, second.positions, tolerance),
        first.positions,
        second.positions,
        origin.source,
        origin.licence,
        first.notes + second.notes,
    )


def named_folders(root: Path, pattern: str) -> list[str]:
    """The names of the folders of this pattern: each is a time, so the oldest is the first."""
    return sorted(path.name for path in root.glob(pattern) if path.is_dir())


def choose_traverses(
    origin: Origin, root: Path, pattern: str, what: str, reference: str | None, query: str | None
) -> tuple[Path, Path]:
    """The folders of two traverses: as named, or the only two that exist, the older first."""
    origin.folder(root, f"with a folder for each {what}")
    if reference is None or query is None:
        found = named_folders(root, pattern)
        if len(found) != 2 or reference is not None or query is not None:
            if not found:
                raise origin.missing(
                    root / pattern, "no such folder", f"at least two of them, each a {what}"
                )
            raise SurefixValueError(
                f"{root}: expected reference and query, each a {what} by name, or exactly two of "
                f"them; found {', '.join(found)}"
            )
        reference, query = found
    first = origin.folder(root / reference, f"the {what} of the references")
    return first, origin.folder(root / query, f"the {what} of the queries")
