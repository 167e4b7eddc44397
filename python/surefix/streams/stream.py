"""What every source of frames is: something to iterate over, that reads a frame when it is wanted,
and not before.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterable, Iterator, Sized
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy.typing as npt

from surefix.streams.frame import Frame

__all__ = ["Derived", "Selection", "Shot", "Stream", "shots_of"]


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """A frame that is not decoded yet: most of a 30 Hz camera's are passed over, and need not be.

    ``read`` decodes it; time, name, dropped and gap are those of the ``Frame``.
    """

    time: float | None
    name: str
    read: Callable[[], npt.NDArray[Any]]
    dropped: int = 0
    gap: bool = False

    def frame(self) -> Frame:
        """The frame, decoded. To be asked for before the next shot is."""
        return Frame(self.read(), self.time, self.name, self.dropped, self.gap)


class Stream(ABC):
    """A source of ``Frame``, in the order that they were taken. Each iteration begins anew.

    Attributes ---------- timed : bool Whether frames say when they were taken. live : bool Whether
    frames come at their own pace, so that a slow reader loses some, and the end is not known. count
    : int or None How many frames there are, where that is known; then ``len`` gives it too.
    """

    timed: bool = False
    live: bool = False

    @abstractmethod
    def shots(self) -> Generator[Shot, None, None]:
        """The frames, undecoded."""

    @property
    def count(self) -> int | None:
        """How many frames there are; None where that is not known."""
        return None

    @property
    def estimate(self) -> int | None:
        """About how many frames there are, for a progress bar; None where nobody can say."""
        return self.count

    @property
    def files(self) -> list[str]:
        """The files that it reads, as far as they are known."""
        return []

    def close(self) -> None:  # noqa: B027 (most do not wait)
        """Ends the iteration that is under way, from any thread, where it would wait for what may
        never come.
        """

    def frames(self) -> Generator[Frame, None, None]:
        """Each frame, decoded. To ``close`` the generator is to let go of files, cameras and
        threads at once.
        """
        with closing(self.shots()) as shots:
            for shot in shots:
                yield shot.frame()

    def __iter__(self) -> Iterator[Frame]:
        """Each frame, decoded."""
        return self.frames()

    def __len__(self) -> int:
        """How many frames; a TypeError where that is not known."""
        if self.count is None:
            raise TypeError(
                f"{type(self).__name__}: how many frames there are is not known beforehand"
            )
        return self.count

    def __bool__(self) -> bool:
        """True: whether there are frames shows when they are read."""
        return True

    def __length_hint__(self) -> int:
        """What ``list`` reserves."""
        return self.estimate or 0


class Derived(Stream):
    """A stream made of another, or of any frames."""

    def __init__(self, source: Iterable[Frame]) -> None:
        self.source = source
        self.timed = source.timed if isinstance(source, Stream) else True
        self.live = source.live if isinstance(source, Stream) else False

    @property
    def source_count(self) -> int | None:
        """How many frames the source has, where that is known."""
        if isinstance(self.source, Stream):
            return self.source.count
        return len(self.source) if isinstance(self.source, Sized) else None

    @property
    def source_estimate(self) -> int | None:
        """About how many frames the source has."""
        return self.source.estimate if isinstance(self.source, Stream) else self.source_count

    @property
    def files(self) -> list[str]:
        """Those of the source."""
        return self.source.files if isinstance(self.source, Stream) else []

    def close(self) -> None:
        """Ends the source's iteration."""
        if isinstance(self.source, Stream):
            self.source.close()


class Selection(Derived):
    """Some of another stream's frames. What is missing before one that is passed over is missing
    before the next.
    """

    @abstractmethod
    def chooser(self) -> Callable[[Shot], bool]:
        """Whether to take each shot, asked in their order; a new one an iteration."""

    def shots(self) -> Generator[Shot, None, None]:
        """Those that are chosen."""
        yield from self.chosen(self.chooser())

    def chosen(self, chooser: Callable[[Shot], bool]) -> Generator[Shot, None, None]:
        """Those that this one chooses."""
        dropped, gap = 0, False
        with closing(shots_of(self.source)) as shots:
            for shot in shots:
                dropped, gap = dropped + shot.dropped, gap or shot.gap
                if chooser(shot):
                    yield replace(shot, dropped=dropped, gap=gap)
                    dropped, gap = 0, False


def shots_of(source: Iterable[Frame]) -> Generator[Shot, None, None]:
    """The shots of a stream, or of anything else that yields frames."""
    if isinstance(source, Stream):
        yield from source.shots()
        return
    for frame in source:
        yield Shot(
            frame.time, frame.name, partial(getattr, frame, "image"), frame.dropped, frame.gap
        )
