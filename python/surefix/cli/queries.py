"""The queries of a drive that is known as a whole: images, ready descriptors, or the frames of a
recording.
"""

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import closing
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix import Map, Sad, SurefixValueError
from surefix._progress import terminal_bar
from surefix.cli.frames import Frames
from surefix.cli.recording import map_of_recording
from surefix.datasets.images import open_images
from surefix.descriptors import Descriptor, extract
from surefix.streams import Frame, Stream

__all__ = ["FrameQueries", "Queries", "RecordedQueries"]

Image = npt.NDArray[np.uint8]
Pictures = Sequence[Image] | Mapping[int, Image]


class Queries(ABC):
    """All queries of a drive, in its order.

    Attributes
    ----------
    ready : array, shape (m, dim), or None
        They themselves, where they are descriptors.
    """

    ready: npt.NDArray[Any] | None = None

    @property
    @abstractmethod
    def names(self) -> list[str] | None:
        """Of the images, where they are images."""

    @abstractmethod
    def __len__(self) -> int:
        """How many."""

    @abstractmethod
    def by_sad(self, sad: Sad) -> npt.NDArray[Any]:
        """The images described, shape (m, dim)."""

    @abstractmethod
    def by_network(self, network: Descriptor, cache: Path | None) -> npt.NDArray[Any]:
        """The images described, shape (m, dim)."""

    @abstractmethod
    def pictures(self, wanted: Collection[int]) -> Pictures | None:
        """The images of these queries at least, by their numbers; None where they are no images."""


class FrameQueries(Queries):
    """A folder or a pattern of images, or a file of images or of descriptors."""

    def __init__(self, place: str) -> None:
        self.frames = Frames(place)
        self.ready = self.frames.descriptors
        self.images = None if self.ready is not None else open_images(Path(place))

    @property
    def names(self) -> list[str] | None:
        """Of the images' files, or their numbers."""
        return None if self.images is None else self.images.names

    def __len__(self) -> int:
        """How many."""
        return len(self.frames)

    def by_sad(self, sad: Sad) -> npt.NDArray[Any]:
        """A map of them, for the parallel reading and describing of one."""
        return Map.from_images(
            self.frames.images, sad, progress=terminal_bar("Describing")
        ).descriptors

    def by_network(self, network: Descriptor, cache: Path | None) -> npt.NDArray[Any]:
        """In batches."""
        return extract(self.frames.images, network, cache=cache)

    def pictures(self, wanted: Collection[int]) -> Pictures | None:
        """All, each read when it is asked for."""
        return self.images


class RecordedQueries(Queries):
    """A video or a bag. It is read once for how many frames there are, and again whenever they are
    wanted.

    All raise a SurefixError as the stream does, and where it has no frames.
    """

    def __init__(self, stream: Stream) -> None:
        self.stream = stream

    @cached_property
    def names(self) -> list[str]:
        """Of the frames."""
        names: list[str] = []
        bar = terminal_bar("Counting")
        with closing(self.stream.shots()) as shots:
            for shot in shots:
                names.append(shot.name)
                if bar is not None:
                    bar(len(names), max(self.stream.estimate or 0, len(names) + 1))
        if bar is not None:
            bar(len(names), len(names))
        if not names:
            raise SurefixValueError(f"{self.stream.files[0]}: expected frames, got none")
        return names

    def __len__(self) -> int:
        """How many."""
        return len(self.names)

    def by_sad(self, sad: Sad) -> npt.NDArray[Any]:
        """Some at a time, in parallel."""
        return map_of_recording(self.stream, sad, None).descriptors

    def by_network(self, network: Descriptor, cache: Path | None) -> npt.NDArray[Any]:
        """In batches, as they are read."""
        bar = terminal_bar("Describing")

        def progress(done: int, _: int) -> None:
            if bar is not None:
                bar(done, len(self))

        def frames() -> Iterator[Frame]:
            with closing(self.stream.frames()) as read:
                yield from read

        return extract(frames(), network, cache=cache, progress=progress)

    def pictures(self, wanted: Collection[int]) -> Pictures | None:
        """These alone, in one reading up to the last of them."""
        with closing(self.stream.shots()) as shots:
            until = islice(shots, max(wanted, default=-1) + 1)
            return {index: shot.read() for index, shot in enumerate(until) if index in wanted}
