"""The images of a map's places, from whatever the map was made of."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix._core import Map
from surefix._progress import Bar, terminal_bar
from surefix.errors import mismatch
from surefix.frames.frame import Frames

UInt8 = npt.NDArray[np.uint8]

# In bytes: what the images of all places may take.
MEMORY = 256_000_000
# In pixels: the long side of a kept image.
SMALLEST, LARGEST = 64, 320


class Thumbnails(Mapping[int, UInt8]):
    """The thumbnails of a map, by place; each is read when it is wanted."""

    def __init__(self, map: Map) -> None:
        self.map = map

    def __getitem__(self, place: int) -> UInt8:
        small = self.map.thumbnail(place)
        if small is None:
            raise KeyError(place)
        return small

    def __iter__(self) -> Iterator[int]:
        return iter(range(len(self)))

    def __len__(self) -> int:
        return len(self.map)


def thumbnails_of(map: Map) -> Thumbnails | None:
    """The thumbnails of a map, if it has some."""
    return None if map.thumbnail(0) is None else Thumbnails(map)


def images_by_name(
    frames: Frames, names: Sequence[str] | None, places: int, where: str = "references"
) -> dict[int, UInt8]:
    """The image of each place, by the name that its frame has; by their order if the map has no
    names. A place without one is left out.

    All frames are read once. Images are made smaller, so that those of a long route fit into
    memory.

    Raises
    ------
    SurefixValueError
        If there is no image of any place.
    """
    wanted: dict[str, list[int]] = {}
    for place, name in enumerate(map(str, range(places)) if names is None else names):
        wanted.setdefault(name, []).append(place)
    long = int(np.clip((MEMORY / (3 * places)) ** 0.5, SMALLEST, LARGEST))
    found: dict[int, UInt8] = {}
    bar = Bar(terminal_bar("Reading references"), frames.count, frames.estimate)
    with closing(frames.shots()) as shots:
        for number, shot in enumerate(shots):
            # A name that comes twice is that of the next place of the name.
            of = wanted.get(shot.name if names is not None else str(number))
            if of:
                found[of.pop(0)] = _smaller(shot.read(), long)
            bar.show(number + 1)
    bar.end(places)
    if not found:
        first = f"its first is {names[0]}" if names else "it has no names"
        raise mismatch(where, "images of the map", f"none: {first}")
    return found


def _smaller(image: npt.NDArray[Any], long: int) -> UInt8:
    step = -(-max(image.shape[:2]) // long)
    return np.array(image[::step, ::step])
