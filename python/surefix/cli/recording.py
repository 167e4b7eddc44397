"""A map from a recording: a video, or a bag."""

from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import overload

import numpy as np
import numpy.typing as npt

from surefix import Map, Sad, SurefixValueError
from surefix._progress import terminal_bar
from surefix.descriptors import Descriptor, extract
from surefix.descriptors.recipe import recipe_of
from surefix.post import Step
from surefix.streams import EveryMetres, Frame, Stream
from surefix.streams.bag import is_bag
from surefix.streams.video import is_video

__all__ = ["is_recording", "learned_map_of_recording", "map_of_recording"]

# Images are described in parallel, so many at a time; no more are held.
AT_ONCE = 128


def is_recording(place: str) -> bool:
    """Whether this names a video or a bag."""
    return is_bag(Path(place)) or is_video(Path(place))


def map_of_recording(stream: Stream, sad: Sad, positions: npt.NDArray[np.float64] | None) -> Map:
    """A map of a stream's frames.

    Its positions are those given; else, where frames are taken by odometry in a plane or in space,
    the odometry's.

    Raises
    ------
    SurefixError
        As the stream does; where there are no frames, or another number of them than of positions.
    """
    route: Map | None = None
    held: list[Frame] = []
    bar = terminal_bar("Describing")
    count = 0
    with closing(stream.frames()) as frames:
        for frame in frames:
            held.append(frame)
            count += 1
            if bar is not None:
                bar(count, max(stream.estimate or 0, count + 1))
            if len(held) == AT_ONCE:
                route = _longer(
                    route,
                    held,
                    sad,
                    _where(stream, [frame.time for frame in held], count, positions),
                )
                held = []
    if held:
        route = _longer(
            route, held, sad, _where(stream, [frame.time for frame in held], count, positions)
        )
    if bar is not None:
        bar(count, count)
    if route is None or (positions is not None and len(positions) != count):
        expected = (
            "frames" if positions is None else f"a frame for each of {len(positions)} positions"
        )
        raise SurefixValueError(f"{stream.files[0]}: expected {expected}, got {count or 'none'}")
    return route


def _longer(
    route: Map | None, frames: list[Frame], sad: Sad, positions: npt.NDArray[np.float64] | None
) -> Map:
    part = Map.from_images(_Named(frames), sad, positions=positions, progress=False)
    return part if route is None else route.extended(part)


def learned_map_of_recording(
    stream: Stream,
    descriptor: Descriptor,
    metric: str,
    positions: npt.NDArray[np.float64] | None,
    cache: Path | None = None,
    post: list[Step] | None = None,
) -> Map:
    """A map of a stream's frames by a learned descriptor; as ``map_of_recording``."""
    seen: list[tuple[str, float | None]] = []

    def watched() -> Iterator[Frame]:
        with closing(stream.frames()) as frames:
            for frame in frames:
                seen.append((frame.name, frame.time))
                yield frame
        if not seen:
            raise SurefixValueError(f"{stream.files[0]}: expected frames, got none")

    bar = terminal_bar("Describing")

    def progress(done: int, total: int) -> None:
        if bar is not None:
            bar(done, done if done == total else max(stream.estimate or 0, done + 1))

    rows = extract(watched(), descriptor, cache=cache, progress=progress)
    if positions is not None and len(positions) != len(rows):
        expected = f"a frame for each of {len(positions)} positions"
        raise SurefixValueError(f"{stream.files[0]}: expected {expected}, got {len(rows)}")
    where = _where(stream, [time for _, time in seen], len(rows), positions)
    names, recipe = [name for name, _ in seen], recipe_of(descriptor)
    return Map.from_descriptors(
        rows, metric, positions=where, names=names, post=post, recipe=recipe
    )


def _where(
    stream: Stream, times: list[float | None], count: int, positions: npt.NDArray[np.float64] | None
) -> npt.NDArray[np.float64] | None:
    """The positions of the frames at these times, the newest of ``count``."""
    if positions is not None:
        part = positions[count - len(times) : count]
        # Too few: said at the end, when it is known how many are lacking.
        return np.pad(part, ((0, len(times) - len(part)), (0, 0)))
    if not isinstance(stream, EveryMetres) or stream.odometry.positions.shape[1] < 2:
        return None
    where = [stream.odometry.at(time) for time in times if time is not None]
    return np.stack([position for position in where if position is not None])


class _Named(Sequence[npt.NDArray[np.uint8]]):
    """Images that a map is made of, with their names."""

    def __init__(self, frames: list[Frame]) -> None:
        self.frames = frames
        self.names = [frame.name for frame in frames]

    def __len__(self) -> int:
        return len(self.frames)

    @overload
    def __getitem__(self, index: int) -> npt.NDArray[np.uint8]: ...
    @overload
    def __getitem__(self, index: slice) -> "_Named": ...
    def __getitem__(self, index: int | slice) -> "npt.NDArray[np.uint8] | _Named":
        return _Named(self.frames[index]) if isinstance(index, slice) else self.frames[index].image
