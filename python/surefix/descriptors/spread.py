"""A map of image files by SAD, a stretch of files a task: the map that one process would make."""

from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from surefix._core import Map, Sad
from surefix._progress import Bar
from surefix._ray import hold, mapped
from surefix.errors import SurefixValueError
from surefix.frames.images import ImageFrames
from surefix.frames.levels import LOOKED_AT, Levels, measured

__all__ = ["files_map"]

# Images of a task.
STRETCH = 128
# A task begins with the first image of all, twice: the others must be like it, and a map has two
# places at least.
LEAD = 2


class _Asked(NamedTuple):
    """What all tasks know."""

    frames: ImageFrames
    sad: Sad
    positions: npt.NDArray[np.float64] | None
    # The first image that can be read.
    first: int
    skip_bad: bool
    how: dict[str, Any]


class FilesMap(NamedTuple):
    """A map, and the indices of the images that could not be read."""

    map: Map
    bad: list[int]


def files_map(
    frames: ImageFrames,
    sad: Sad,
    positions: npt.NDArray[np.float64] | None,
    report: Any,
    *,
    skip_bad: bool,
    **how: Any,
) -> FilesMap | None:
    """The map; None if fewer than two images can be read.

    Levels of deep images are measured on those that can be read, as ``Map.from_images`` does.
    """
    first = _first(frames, skip_bad)
    if first is None:
        return None
    levels = sad.levels or _levels(frames, first)
    known = Sad(sad.size, sad.patch, sad.dtype, levels)
    made = _described(_Asked(frames, known, positions, first, skip_bad, how), report)
    if made is None or not made.bad or levels == sad.levels:
        return made
    left = [index for index in range(len(frames)) if index not in {*made.bad}]
    where = None if positions is None else positions[left]
    some = frames.taken(left)
    levels = _levels(some, 0)
    if levels == known.levels:
        return made
    known = Sad(sad.size, sad.patch, sad.dtype, levels)
    again = _described(_Asked(some, known, where, 0, False, how), report)
    return None if again is None else FilesMap(again.map, made.bad)


def _described(asked: _Asked, report: Any) -> FilesMap | None:
    count = len(asked.frames)
    bar = Bar(report, count, None)
    bar.show(0)
    route: Map | None = None
    kept: list[int] = []
    bad: list[int] = []
    stretches = [range(k, min(k + STRETCH, count)) for k in range(0, count, STRETCH)]
    parts = mapped(_stretch, hold(asked), stretches)
    for stretch, (part, missing) in zip(stretches, parts, strict=True):
        begin = (0 if route is None else len(route)) + LEAD
        route = part if route is None else route.extended(part)
        kept += range(begin, len(route))
        bad += missing
        bar.show(stretch.stop)
    if route is None or len(kept) < 2:
        return None
    return FilesMap(route.keep(kept), bad)


def _stretch(asked: _Asked, stretch: range) -> tuple[Map, list[int]]:
    """The map of the first image, twice, and of some more; and the indices of those that cannot be
    read.
    """
    which = [*[asked.first] * LEAD, *stretch]
    where = None if asked.positions is None else asked.positions[which]
    given: dict[str, Any] = {"skip_bad": asked.skip_bad, "progress": False, **asked.how}
    made = Map.from_images(asked.frames.taken(which).source, asked.sad, positions=where, **given)
    missing: list[int] = []
    if len(made) < len(which):
        for index in stretch:
            try:
                _ = asked.frames.images[index]
            except SurefixValueError:
                missing.append(index)
    return made, missing


def _first(frames: ImageFrames, skip_bad: bool) -> int | None:
    for index in range(len(frames)):
        try:
            _ = frames.images[index]
        except SurefixValueError:
            if not skip_bad:
                raise
        else:
            return index
    return None


def _levels(frames: ImageFrames, first: int) -> Levels | None:
    """By the first image and 31 others, evenly spread."""
    opening = frames.images[first]
    if opening.dtype != np.uint16:
        return None
    count = len(frames)
    looked_at = min(count, LOOKED_AT)
    seen: list[npt.NDArray[Any]] = [opening]
    for step in range(1, looked_at):
        with suppress(SurefixValueError):
            seen.append(frames.images[step * (count - 1) // (looked_at - 1)])
    return measured(seen)
