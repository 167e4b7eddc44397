"""Images and a track, each with its own times: images with positions, one every few metres."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from surefix.datasets.pair import Origin, Pair
from surefix.errors import SurefixValueError, mismatch, refusal
from surefix.frames.images import Images
from surefix.tables.metres import interpolate, pair_by_position, subsample
from surefix.tables.rows import ascending, rows, whole

Int64 = npt.NDArray[np.int64]
Float64 = npt.NDArray[np.float64]
ImagesOf = Callable[[list[Path]], Images]


class Track(NamedTuple):
    """The positions of a vehicle, (n, d) in metres, at ascending ``stamps`` (n,)."""

    path: Path
    stamps: Int64
    positions: Float64


class Drive(NamedTuple):
    """The images of a folder, named by their ascending ``stamps``, their listing and the track."""

    folder: Path
    stamps: Int64
    listed_in: Path
    track: Track


@dataclass(frozen=True)
class Placing:
    """Gives each image the position of its time, and keeps one every ``spacing`` metres.

    An image without a file, or at a time in a gap of the track, is left out or an error.
    """

    origin: Origin
    ticks_a_second: int
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

    def pair(self, name: str, drives: Sequence[Drive], images: ImagesOf, tolerance: float) -> Pair:
        """Two drives paired by position: the truth is the nearest reference within a tolerance."""
        (files, there, notes), (driven, here, more) = (self._placed(drive) for drive in drives)
        truth = pair_by_position(there, here, tolerance)
        origin = self.origin.source, self.origin.licence
        return Pair(name, images(files), images(driven), truth, there, here, *origin, notes + more)

    def _placed(self, drive: Drive) -> tuple[list[Path], Float64, tuple[str, ...]]:
        """The files that are kept, the position of each, and notes on those left out."""
        folder, stamps, listed_in, track = drive
        files = [folder / f"{stamp}.png" for stamp in stamps]
        try:
            present = {path.name for path in folder.iterdir()}
        except OSError as error:
            raise refusal(folder, "cannot list the images", error) from None
        on_disk = np.array([file.name in present for file in files], dtype=np.bool_)
        gap = int(min(self.longest_gap * self.ticks_a_second, 2.0**62))
        positions, known = interpolate(stamps, track.stamps, track.positions, gap)
        notes = []
        if not on_disk.all():
            first = files[int(np.argmin(on_disk))]
            missing = f"{int((~on_disk).sum())} of the {len(files)} images"
            counted = f"{missing} that {listed_in} lists are not there"
            if self.incomplete == "error" or not on_disk.any():
                raise self.origin.missing(first, "no such image", counted)
            notes.append(f"Left out: {counted}, the first is {first.name}")
        placeless = on_disk & ~known
        if placeless.any():
            first = files[int(np.argmax(placeless))]
            missing = f"{int(placeless.sum())} of the {int(on_disk.sum())} images"
            counted = f"{missing} in {folder} have no position"
            where = f"in {track.path} around their time, the first is {first.name}"
            if self.incomplete == "error" or not known[on_disk].any():
                raise SurefixValueError(f"{counted} {where}")
            notes.append(f"Left out: {counted} {where}")
        kept = np.flatnonzero(on_disk & known)
        if self.spacing is not None:
            kept = kept[subsample(positions[kept], self.spacing)]
        return [files[i] for i in kept.tolist()], positions[kept], tuple(notes)


def read_stamps(listing: Path, header: str, what: str, columns: int | None = None) -> Int64:
    """The ascending times in the first column of a listing, of some number of ``columns``."""
    stamps, numbers = [], []
    for row, cells in rows(listing, None):
        if columns is not None and len(cells) != columns:
            raise mismatch(f"{listing}, row {row}", f"{columns} values ({header})", len(cells))
        stamps.append(whole(cells[0], listing, row, what))
        numbers.append(row)
    if not stamps:
        raise mismatch(listing, f"lines of {header}", "none")
    return ascending(stamps, numbers, listing)


def named_folders(root: Path, pattern: str) -> list[str]:
    """The names of the folders of this pattern: each is a time, so the oldest is the first."""
    return sorted(path.name for path in root.glob(pattern) if path.is_dir())


def choose_traverses(
    origin: Origin, root: Path, what: str, reference: str | None, query: str | None
) -> tuple[Path, Path]:
    """The folders of two traverses: as named, or the only two that exist, the older first."""
    origin.folder(root, f"with a folder for each {what}")
    if reference is None or query is None:
        (pattern,) = origin.signs
        found = named_folders(root, pattern)
        if not found:
            purpose = f"at least two of them, each a {what}"
            raise origin.missing(root / pattern, "no such folder", purpose)
        if len(found) != 2 or reference is not None or query is not None:
            expected = f"reference and query, each a {what} by name, or exactly two of them"
            raise SurefixValueError(f"{root}: expected {expected}; found {', '.join(found)}")
        reference, query = found
    first = origin.folder(root / reference, f"the {what} of the references")
    return first, origin.folder(root / query, f"the {what} of the queries")
