"""The images of queries and of places for the report of ``surefix eval``."""

from collections.abc import Collection, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from surefix import Map
from surefix.cli import inputs
from surefix.errors import mismatch
from surefix.frames import Frames, ImageFrames
from surefix.frames.by_name import UInt8, images_by_name
from surefix.frames.images import Images, ShownImages, open_images
from surefix.frames.levels import in_8_bits
from surefix.frames.opening import is_recording
from surefix.frames.recording import is_bag

if TYPE_CHECKING:
    from surefix.report.album import Album

Pictures: TypeAlias = Sequence[UInt8] | Mapping[int, UInt8]


def pictures_of(
    frames: Frames, wanted: Collection[int], levels: tuple[int, int] | None
) -> tuple[Pictures | None, "Album | None"]:
    """The images of these frames at least, and of a recording, which is read again, small copies
    of all.
    """
    from surefix.report.album import Album

    if isinstance(frames, ImageFrames):
        return None if frames.ready is not None else ShownImages(frames.images, levels), None
    chosen, album = {}, Album()
    with closing(frames.shots()) as shots:
        for index, shot in enumerate(shots):
            if index not in wanted and not album.wants(index):
                continue
            image = in_8_bits(shot.read(), levels)
            album.add(index, image)
            if index in wanted:
                chosen[index] = image
    return chosen, album


def reference_images(
    place: str, places: int, known: Map | None, topic: str | None = None
) -> Images | dict[int, UInt8]:
    """An image for each place, of whatever the map was made of: by the names of its places, if they
    have names that the images have too, else by their order.
    """
    option, names = f"--references {place}", None if known is None else known.names
    if is_recording(place):
        frames = inputs.open_frames(place, topic=topic if is_bag(place) else None)
        found = images_by_name(frames, names, places, option)
        if len(found) != places:
            raise mismatch(option, f"images of {places} places", len(found))
        return found
    images = open_images(Path(place))
    rows = _by_name(images.names, names or ())
    if len(rows) == places:
        return images.take(rows)
    if len(images) != places:
        raise mismatch(option, f"an image for each of {places} places", len(images))
    return images


def _by_name(images: Sequence[str], names: Sequence[str]) -> list[int]:
    """The index of the image of each place, those of one name in turn; none if a place lacks it."""
    of: dict[str, list[int]] = {}
    for index, name in reversed([*enumerate(images)]):
        of.setdefault(name, []).append(index)
    try:
        return [of[name].pop() for name in names]
    except (KeyError, IndexError):
        return []
