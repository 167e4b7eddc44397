"""Inputs that several commands take: images or recordings, and the network of a map."""

import glob
import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
import typer

from surefix import Map, SurefixError, SurefixValueError, find_images, frames
from surefix._words import plural
from surefix.errors import SurefixFileError
from surefix.frames.opening import is_recording
from surefix.post import Normalize, Pca, RandomProjection, Standardize, Step
from surefix.tables.metres import places_per_metre
from surefix.tables.vectors import ENDINGS


class Place(str):
    """The name of images or of a recording; or of some images of a folder, with their ``files``. As
    an annotation: an argument that may be several names on the command line (``one_place``).
    """

    files: Sequence[str] = ()


Topic = Annotated[
    str | None, typer.Option(help="A bag: the topic of the images, if there are several.")
]
Stride = Annotated[int, typer.Option(min=1, help="Take every n-th frame.")]
Every = Annotated[
    float | None, typer.Option(help="A video or a bag: take a frame every this many seconds.")
]
Metres = Annotated[
    float | None,
    typer.Option(help="Take a frame every this many metres, by --odometry."),
]
Odometry = Annotated[
    str | None,
    typer.Option(
        help="A .csv with the columns time and x,y[,z] or distance, a trajectory of TUM, KITTI or "
        "EuRoC, or a topic of poses of the bag."
    ),
]

Order = Annotated[
    Literal["name", "decimals", "whole", "time", "exif"],
    typer.Option(
        help="The order of a folder's images: by their names (numbers with a point: decimals or "
        "whole say how to read the digits after it), by the time of the files' last change, or by "
        "the time at which the camera took them (EXIF)."
    ),
]
Strict = Annotated[
    bool,
    typer.Option(
        "--strict",
        help="Stop at an image or a frame that cannot be read, instead of passing over it.",
    ),
]
Spreadsheet = Annotated[
    bool,
    typer.Option(
        "--spreadsheet",
        help="CSV for a spreadsheet: text that would be a formula there gets a ' before it.",
    ),
]
Crop = Annotated[
    bool,
    typer.Option(
        "--crop", help="Cut images of another shape than the map's around their centre to that."
    ),
]

Spacing = Annotated[
    float | None,
    typer.Option(
        help="--odometry: metres from one place of the map to the next; by default by the map's "
        "positions."
    ),
]
PlacesPerMetre = Annotated[
    float | None,
    typer.Option(help="The same the other way round; below 0 if the robot drives backward."),
]

NO_SCALE = "--odometry: expected a map with positions, --spacing or --places-per-metre"

Cache = Annotated[
    Path | None,
    typer.Option(
        help="--model: keep the vectors in this file, and resume from it after an interruption."
    ),
]


def refuse(wrong: bool, message: str) -> None:
    """Ends the command as bad usage if it is wrong."""
    if wrong:
        raise typer.BadParameter(message)


def open_frames(
    place: str,
    key: str | None = None,
    *,
    order: str = "name",
    strict: bool = False,
    crop: tuple[int, int] | None = None,
    **sampling: Any,
) -> frames.Frames:
    """The frames of a video or a bag, or of images with odometry, sampled; or all those of images
    or an array. Bad frames of recordings are passed over unless ``strict``.
    """
    array = Path(place).suffix.lower() in ENDINGS
    stride = sampling.get("stride", 1)
    by_time = any(sampling.get(name) is not None for name in ("odometry", "gap"))
    recording = is_recording(place) or (by_time and not array)
    refuse(key is not None and recording, f"--key: expected descriptors, got the recording {place}")
    if key is not None and not array:
        raise SurefixValueError(f"--key: expected a file of descriptors, got {place}")
    refuse(order != "name" and array, f"--order: expected a folder of images, got {place}")
    if recording:
        moved = any(sampling.get(name) is not None for name in ("metres", "places_per_metre"))
        alone = sampling.get("odometry") is not None and not moved
        refuse(alone, "--odometry: expected --metres too, got none")
        more: dict[str, Any] = {"order": order, "skip_bad": not strict, "crop": crop}
        return frames.open(place, **sampling, **more)
    check_sampling(place, **(sampling | {"stride": 1}))
    with naming_folders(place):
        images = frames.ImageFrames(listed(place), key, order=order)
    if stride != 1:
        images = images.taken(range(0, len(images), stride))
    if crop is None or images.ready is not None:
        return images
    cut = frames.Crop(images, crop)
    return cut if strict else frames.SkipBad(cut)


@contextmanager
def naming_folders(place: str) -> Iterator[None]:
    """Refuses a name of nothing, and names the folders with images that lie in a folder without
    any, in its refusal.
    """
    try:
        yield
    except SurefixFileError:
        if not is_recording(place):
            check_there(place, "images")
        raise
    except SurefixValueError as error:
        path = Path(place)
        if not (str(error).startswith(f"{place}: ") and path.is_dir()):
            raise
        inside = [each for each in sorted(path.iterdir()) if each.is_dir() and _has_images(each)]
        if not inside or _has_images(path):
            raise
        named = ", ".join(map(str, inside[:5])) + (" and more" if len(inside) > 5 else "")
        raise SurefixValueError(f"{error}; folders in it have some: {named}") from None


def check_there(place: str, expected: str) -> None:
    """Refuses a name of no file and no folder; one like it that there is, is named."""
    path = Path(place)
    if path.exists() or any(sign in place for sign in "*?["):
        return
    near = [each.name for each in path.parent.iterdir()] if path.parent.is_dir() else []
    like = get_close_matches(path.name, near, 1)
    hint = f"; did you mean {path.parent / like[0]}?" if like else ""
    raise SurefixFileError(f"{place}: expected {expected}, got no such file or folder{hint}")


def _has_images(folder: Path) -> bool:
    try:
        return bool(find_images(folder))
    except SurefixError:
        return False


def one_place(given: Sequence[str] | None) -> str | None:
    """The name of a folder, a file or a pattern; of several files, as the shell makes of a pattern
    without quotes, that pattern, or these images of their folder.
    """
    if not given:
        return None
    if len(given) == 1:
        return given[0]
    start, end = _common(given), _common([name[::-1] for name in given])[::-1]
    end = end[max(0, len(start) + len(end) - min(map(len, given))) :]
    # The shell orders them by the alphabet, and cannot be told to count: find them anew.
    pattern = f"{glob.escape(start)}*{glob.escape(end)}"
    if sorted(glob.glob(pattern)) == sorted(given):
        return pattern
    wanted = {Path(name) for name in given}
    folders = {path.parent for path in wanted}
    there = (
        find_images(folders.pop()) if len(folders) == 1 and all(map(Path.is_file, wanted)) else []
    )
    place = Place(f"{given[0]} and {len(given) - 1} more")
    place.files = [name for name in there if Path(name) in wanted]
    if len(place.files) == len(wanted):
        return place
    expected = "expected a folder, a file, a pattern, or images of one folder"
    raise typer.BadParameter(
        f"{expected}, got {', '.join(given[:3])} and so on, {len(given)} names; a pattern as ROUTE "
        "must be quoted"
    )


def listed(place: str) -> str | Sequence[str]:
    """The place as ``surefix.frames.open`` takes it."""
    return place.files if isinstance(place, Place) and place.files else place


def _common(names: Sequence[str]) -> str:
    """The characters that all begin with."""
    first, last = min(names), max(names)
    pairs = zip(first, last, strict=False)
    return first[: next((at for at, (a, b) in enumerate(pairs) if a != b), len(first))]


def crop_of(known: Map, wanted: bool) -> tuple[int, int] | None:
    """The size whose shape ``--crop`` cuts to."""
    if not wanted:
        return None
    unknown = known.image_size is None
    refuse(unknown, "--crop: expected a map that knows the size of its images; this one does not")
    return known.image_size


def notes_on(given: frames.Frames, kept: Sequence[str] | None = None) -> list[str]:
    """What to say of the frames in a command's last line: the files that were left out, and the
    images and frames that were passed over. ``kept`` are the names of those that were used.
    """
    notes: list[str] = []
    bad: list[str] = []
    source: Any = given
    while isinstance(source, frames.Frames):
        bad += getattr(source, "bad", [])
        notes += source.remarks
        if isinstance(source, frames.ImageFrames) and kept is not None and not bad:
            names = source.images.names
            bad = [names[index] for index in missing(names, kept)]
        source = getattr(source, "source", None)
    if bad:
        some = ", ".join(bad[:3]) + (f" and {len(bad) - 3} more" if len(bad) > 3 else "")
        notes.insert(0, f"{plural(len(bad), 'bad frame')} passed over: {some}")
    return [*dict.fromkeys(notes)]


def missing(names: Sequence[str], kept: Sequence[str]) -> list[int]:
    """The indices of the names that are not among the kept ones, which are in order."""
    found, at = [], 0
    for index, name in enumerate(names):
        if at < len(kept) and kept[at] == name and len(names) - index >= len(kept) - at:
            at += 1
        else:
            found.append(index)
    return found


def scale_of(
    where: npt.NDArray[np.float64] | None, spacing: float | None, rate: float | None
) -> tuple[float | None, str]:
    """Places per metre, None if unknown, and what they are known by."""
    refuse(spacing is not None and rate is not None, "--spacing: not with --places-per-metre too")
    zero = rate is not None and not (math.isfinite(rate) and rate)
    refuse(zero, f"--places-per-metre: expected a number other than 0, got {rate}")
    if rate is not None:
        return rate, "--places-per-metre"
    if spacing is not None:
        return 1 / spacing, f"--spacing {spacing:g}"
    if where is None or not np.ptp(where, axis=0).any():
        return None, ""
    return places_per_metre(where), "the map's positions"


def check_sampling(got: object, stride: int = 1, **sampling: Any) -> None:
    """Refuses sampling if there is no recording."""
    options = "--topic, --stride, --every, --metres, --odometry"
    options += ", --gap" if "gap" in sampling else ""
    given = stride != 1 or any(value is not None for value in sampling.values())
    refuse(given, f"{options}: expected a video or a bag, got {got}")


def refuse_map(argument: str, place: str) -> None:
    """Refuses a map that is given as a drive."""
    path = Path(place)
    if not path.is_file():
        return
    with path.open("rb") as file:
        length, brace = int.from_bytes(file.read(8), "little"), file.read(1)
    # A file of safetensors, as a map is.
    if brace != b"{" or length > path.stat().st_size:
        return
    try:
        Map.open(path, mmap=True)
    except SurefixError:
        return
    expected = f"{argument}: expected images or descriptors of a drive"
    refuse(True, f"{expected}, got {place}, which is a map: use surefix map join")


def check_not_read(out: Path, files: Iterable[Path | str | None], option: str = "--out") -> None:
    """Refuses to write a file that is read."""
    given = [Path(file) for file in files if file is not None]
    same = out.exists() and any(file.exists() and out.samefile(file) for file in given)
    refuse(same, f"{option}: {out} is what is read here; name another file")


def check_apart(files: Mapping[str, Path | None]) -> None:
    """Refuses to write one file twice; the files by their options."""
    seen: dict[str, str] = {}
    for option, file in files.items():
        if file is not None:
            other = seen.setdefault(os.path.realpath(file), option)
            refuse(other != option, f"{option}: {file} is that of {other}; name another file")


def steps_of(text: str) -> list[Step]:
    """The steps of ``--post``: names with commas, such as ``standardize,pca:512,normalize``."""
    plain: dict[str, Step] = {
        "standardize": Standardize(),
        "standardize:running": Standardize("running"),
        "normalize": Normalize(),
    }
    reductions: dict[str, Any] = {"pca": Pca, "projection": RandomProjection}
    steps: list[Step] = []
    for part in text.split(","):
        step = part.strip().removesuffix(":")
        name, _, number = step.partition(":")
        count = int(number) if number.isdecimal() else 0
        if step in plain:
            steps.append(plain[step])
        elif name in reductions and count:
            steps.append(reductions[name](count))
        else:
            known = "standardize, standardize:running, pca:N, projection:N and normalize"
            raise typer.BadParameter(f"--post: expected {known}, with commas, got {part!r}")
    return steps
