"""The images of queries and of places for the report of ``surefix eval``."""

from collections.abc import Collection, Mapping, Sequence
from contextlib import closing
from itertools import islice
from pathlib import Path
from typing import TypeAlias

from surefix import Map
from surefix.cli import inputs
from surefix.errors import mismatch
from surefix.frames import Frames, ImageFrames
from surefix.frames.by_name import UInt8, images_by_name
from surefix.frames.images import Images, ShownImages, open_images
from surefix.frames.levels import in_8_bits
from surefix.frames.opening import is_recording

Pictures: TypeAlias = Sequence[UInt8] | Mapping[int, UInt8]


def pictures_of(
    frames: Frames, wanted: Collection[int], levels: tuple[int, int] | None
) -> Pictures | None:
    """The images of these frames at least; a recording is read again, up to the last of them."""
    if isinstance(frames, ImageFrames):
        return None if frames.ready is not None else ShownImages(frames.images, levels)
    with closing(frames.shots()) as shots:
        until = islice(shots, max(wanted, default=-1) + 1)
        chosen = ((index, shot) for index, shot in enumerate(until) if index in wanted)
        return {index: in_8_bits(shot.read(), levels) for index, shot in chosen}


def reference_images(place: str, places: int, known: Map | None) -> Images | dict[int, UInt8]:
    """An image for each place."""
    if is_recording(place):
        names = None if known is None else known.names
        frames = inputs.open_frames(place)
        found = images_by_name(frames, names, places, f"--references {place}")
        if len(found) != places:
            raise mismatch(f"--references {place}", f"images of {places} places", len(found))
        return found
    images = open_images(Path(place))
    if len(images) != places:
        expected = f"an image for each of {places} places"
        raise mismatch(f"--references {place}", expected, len(images))
    return images
