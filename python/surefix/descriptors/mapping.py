"""Maps of frames: described by a network, or by SAD some at a time."""

from collections.abc import Generator, Sequence
from contextlib import closing, suppress
from itertools import islice
from os import PathLike
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix._core import Map, Sad, Segments
from surefix._progress import Bar, Progress, terminal_bar
from surefix._ray import is_spread
from surefix.descriptors.descriptor import recipe_of, same_vectors
from surefix.descriptors.extraction import described
from surefix.descriptors.pictures import Pictured, Wanted, size_of
from surefix.descriptors.spread import files_map
from surefix.errors import SurefixValueError, mismatch
from surefix.frames.frame import Frame, Frames, Shot
from surefix.frames.images import ImageArray, ImageFiles, ImageFrames, frames_of
from surefix.frames.levels import LOOKED_AT, Levels, measured
from surefix.frames.nearest import EveryMetres
from surefix.frames.sampling import Derived

# Images are described in parallel, this many at a time; no more are held.
AT_ONCE = 128
Positions = npt.NDArray[np.float64] | None


def map_of_images(
    images: Any,
    descriptor: Any,
    metric: str = "cosine",
    positions: Any = None,
    post: Any = None,
    cache: str | PathLike[str] | None = None,
    progress: Progress | None = None,
    levels: Levels | None = None,
    skip_bad: bool = False,
    breaks: Any = None,
    closed: Any = False,
    thumbnails: Wanted = False,
    origin: Any = None,
) -> Map:
    """The map of images, described by a network. Names are kept if they are frames or counted.
    Levels of deep images are measured if they are not given, and stand in the recipe.
    """
    frames = frames_of(images)
    _check_positions(frames, positions, origin)
    if origin is not None and positions is None and not _placed_by(frames):
        raise mismatch("origin", "positions beside it", "none")
    size_of(thumbnails)
    if frames.count is not None:
        Segments(frames.count, breaks, closed)
    first = _first(frames, skip_bad)
    if levels is None and first is not None and first.dtype == np.uint16:
        levels = levels_of(frames)
    bad: set[int] | None = set() if skip_bad else None
    how: dict[str, Any] = {"levels": levels, "bad": bad}
    seen = Pictured(frames, thumbnails, levels) if thumbnails else frames
    rows, shots = described(seen, descriptor, cache=cache, progress=progress, **how)
    segments = _segments(breaks, closed, len(rows), bad)
    positions = _kept(positions, bad)
    if isinstance(images, Frames):
        positions = _positions(images, shots, positions)
    named = frames.count is not None or isinstance(images, Frames)
    names = [shot.name for shot in shots] if named else None
    recipe = recipe_of(descriptor) | ({} if levels is None else {"levels": [*levels]})
    size = None if first is None or first.ndim < 2 else first.shape[1::-1]
    made: dict[str, Any] = {"post": post, "recipe": recipe, "image_size": size, "origin": origin}
    route = Map.from_descriptors(rows, metric, positions, names, **made).with_segments(segments)
    if isinstance(seen, Pictured):
        return route.with_thumbnails(seen.pictures(len(rows), bad))
    return route


def _segments(breaks: Any, closed: Any, places: int, bad: set[int] | None) -> Segments:
    """The segments of the images that were not passed over."""
    count = places + len(bad or ())
    segments = Segments(count, breaks, closed)
    return segments.keep([at for at in range(count) if at not in bad]) if bad else segments


def levels_of(frames: Frames) -> Levels | None:
    """The levels of a map of these frames, by up to 32 of them; None if they have 8 bits."""
    every = max((frames.estimate or LOOKED_AT) // LOOKED_AT, 1)

    def looked_at() -> Generator[npt.NDArray[Any], None, None]:
        with closing(frames.shots()) as shots:
            for shot in islice(shots, None, None, every):
                with suppress(SurefixValueError):
                    yield shot.read()

    return measured(looked_at())


def _first(frames: Frames, skip_bad: bool) -> npt.NDArray[Any] | None:
    """The first image that can be read; None if that would use up the frames."""
    if frames.count is None and not frames.files:
        return None
    with closing(frames.shots()) as shots:
        for shot in shots:
            try:
                return np.asarray(shot.read())
            except SurefixValueError:
                if not skip_bad:
                    raise
    return None


def append_images(
    path: Any,
    images: Any,
    descriptor: Any,
    positions: Any = None,
    cache: str | PathLike[str] | None = None,
    progress: Progress | None = None,
    skip_bad: bool = False,
    new_segment: bool = False,
) -> None:
    """The map in the file made longer by images, described and post-processed as its own were."""
    old = Map.open(path, mmap=True)
    frames = frames_of(images)
    # Before anything is described.
    _check_own(old, descriptor)
    plane = old.origin or old.plane
    _check_positions(frames, positions, plane)
    if old.segments[-1].closed and not new_segment:
        expected = "a new segment (new_segment=True), as its last segment is closed"
        raise mismatch(path, expected, "images that go on with the last one")
    levels = old.levels
    bad: set[int] | None = set() if skip_bad else None
    how: dict[str, Any] = {"levels": levels, "bad": bad}
    small = _picture_size(old)
    seen = frames if small is None else Pictured(frames, small, levels)
    rows, shots = described(seen, descriptor, cache=cache, progress=progress, **how)
    positions = _kept(positions, bad)
    if isinstance(images, Frames):
        positions = _positions(images, shots, positions)
    names = None
    if old.names is not None:
        # Those that are only numbers count on.
        known = enumerate(shot.name for shot in shots)
        names = [str(len(old) + i) if name == str(i) else name for i, name in known]
    recipe = old.recipe or recipe_of(descriptor)
    made: dict[str, Any] = {"post": old.post, "recipe": recipe}
    if positions is not None:
        made["origin"] = plane
    more = Map.from_descriptors(rows, old.metric, positions, names, **made)
    if isinstance(seen, Pictured):
        more = more.with_thumbnails(seen.pictures(len(rows), bad))
    del old
    Map.append(path, more, new_segment=new_segment)


def sad_map(
    frames: Frames,
    sad: Sad,
    positions: Positions = None,
    *,
    skip_bad: bool = False,
    mixed_sizes: bool = False,
    breaks: Any = None,
    closed: Any = False,
    thumbnails: Wanted = False,
    origin: Any = None,
) -> Map:
    """A map of frames by SAD, with the positions given, else those of the odometry."""
    report = terminal_bar("Describing")
    how: dict[str, Any] = {"breaks": breaks, "closed": closed, "origin": origin}
    if isinstance(frames, ImageFrames):
        how |= {"skip_bad": skip_bad, "mixed_sizes": mixed_sizes, "thumbnails": thumbnails}
        if is_spread() and isinstance(frames.images, ImageFiles):
            size_of(thumbnails)
            Segments(len(frames), breaks, closed)
            _check_positions(frames, positions, origin)
            del how["breaks"], how["closed"]
            files = files_map(frames, sad, positions, report, **how)
            if files is not None:
                bad = {*files.bad}
                segments = _segments(breaks, closed, len(files.map), bad)
                return files.map.with_segments(segments)
            how |= {"breaks": breaks, "closed": closed}
        return Map.from_images(frames.source, sad, positions=positions, progress=report, **how)
    if frames.count is not None:
        Segments(frames.count, breaks, closed)
    bar = Bar(report, None, frames.estimate)
    route: Map | None = None
    count = 0
    # All parts have that of the first.
    size: Any = thumbnails
    with closing(frames.frames()) as source:
        while part := list(islice(source, AT_ONCE)):
            images = ImageArray([frame.image for frame in part], [frame.name for frame in part])
            if positions is None:
                where = _positions(frames, part, None)
            else:
                # If they are too few, the error comes at the end, with the number of frames.
                where = positions[count : count + len(part)]
                where = np.pad(where, ((0, len(part) - len(where)), (0, 0)))
            if sad.levels is None and images[0].dtype == np.uint16:
                levels = levels_of(frames)
                sad = Sad(sad.size, sad.patch, sad.dtype, levels)
            parts: dict[str, Any] = {"progress": False, "mixed_sizes": mixed_sizes}
            plane = None if where is None else origin
            made = Map.from_images(
                images, sad, positions=where, origin=plane, thumbnails=size, **parts
            )
            size = _picture_size(made) or size
            route = made if route is None else route.extended(made)
            count += len(part)
            bar.show(count)
    bar.end(count)
    if route is None:
        raise mismatch(frames.files[0], "frames", "none")
    if positions is not None and len(positions) != count:
        raise _not_each(frames, len(positions), count)
    return route.with_segments(Segments(count, breaks, closed))


def _picture_size(route: Map) -> tuple[int, int] | None:
    """Width and height of a map's thumbnails, if it has any."""
    picture = route.thumbnail(0)
    return None if picture is None else (picture.shape[1], picture.shape[0])


def _kept(positions: Any, bad: set[int] | None) -> Any:
    """The positions without those of images that were passed over."""
    return (
        np.delete(np.asarray(positions), [*bad], axis=0)
        if bad and positions is not None
        else positions
    )


def _positions(frames: Frames, taken: Sequence[Frame | Shot], positions: Any) -> Any:
    """The positions of the frames that were taken: the given ones, or the odometry's."""
    if positions is not None:
        if len(positions) != len(taken):
            raise _not_each(frames, len(positions), len(taken))
        return positions
    placed = _placed_by(frames)
    if placed is None:
        return None
    times = [frame.time if frame.clock is None else frame.clock for frame in taken]
    where = [placed.odometry.at(time) for time in times if time is not None]
    return np.stack([position for position in where if position is not None])


def _placed_by(frames: Frames) -> EveryMetres | None:
    """The frames whose odometry gives positions, if it does."""
    while isinstance(frames, Derived) and not isinstance(frames, EveryMetres):
        frames = frames.source
    if isinstance(frames, EveryMetres) and frames.odometry.positions.shape[1] >= 2:
        return frames
    return None


def _not_each(frames: Frames, positions: int, got: int) -> SurefixValueError:
    source = frames.files[0] if frames.files else "frames"
    return mismatch(source, f"a frame for each of {positions} positions", got)


def _check_own(route: Map, descriptor: Any) -> None:
    if route.descriptor is not None:
        expected = f"{route.descriptor!r}, as the map's own"
        raise mismatch("descriptor", expected, repr(descriptor.name))
    recipe = recipe_of(descriptor)
    # Levels are of the images, and not of the network.
    own = {key: value for key, value in (route.recipe or {}).items() if key != "levels"}
    if own and not same_vectors(own, recipe):
        raise mismatch("descriptor", f"the map's own, by the recipe {own}", recipe)


def _check_positions(frames: Frames, positions: Any, origin: Any = None) -> None:
    """Refuses wrong positions before the network has seen the whole drive."""
    if positions is not None and frames.count is not None:
        rows = np.zeros((frames.count, 1), np.float32)
        Map.from_descriptors(rows, "euclidean", positions=positions, origin=origin)
