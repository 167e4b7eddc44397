"""Images in order: ``Frames``, each decoded when it is wanted."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence, Sized
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """An image, when it was taken, and the frames that are missing before it.

    Attributes
    ----------
    image : array of uint8 or uint16, shape (H, W) grey or (H, W, 3) RGB
        uint16 if it has more than 8 bits. From a file of ready descriptors, one of them: shape
        (dim,).
    time : float or None
        In seconds: since 1970 from a camera, a bag or a folder that grows, since the start from a
        video. None if the source has no times.
    name : str
        A file's name, or the frame's number in its video, its topic or its array.
    dropped : int
        The number of frames lost between the one before and this one.
    gap : bool
        Whether time is missing before this frame.
    advance : float or None
        The number of places that the robot has moved since the frame before, negative backwards,
        by its odometry; None if that is unknown.
    clock : float or None
        Its time by the odometry's clock, if that is not ``time``.
    breaks : bool
        A gap, or dropped frames: the matcher must be told, by ``Localizer.gap``.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.frames import Frame
    >>> Frame(np.zeros((4, 6), np.uint8), time=12.5, name="125", dropped=2)
    Frame('125', 4 x 6, time=12.5, dropped=2)
    """

    image: npt.NDArray[np.uint8]
    time: float | None
    name: str
    dropped: int = 0
    gap: bool = False
    advance: float | None = None
    clock: float | None = None

    @property
    def breaks(self) -> bool:
        """Whether the drive is broken before this frame: a gap, or dropped frames."""
        return self.gap or self.dropped > 0

    def __repr__(self) -> str:
        parts = [repr(self.name), " x ".join(map(str, self.image.shape[:2]))]
        parts += [] if self.time is None else [f"time={self.time}"]
        parts += [f"dropped={self.dropped}"] if self.dropped else []
        parts += ["gap=True"] if self.gap else []
        parts += [] if self.advance is None else [f"advance={self.advance:.4g}"]
        return f"Frame({', '.join(parts)})"


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """A frame before it is decoded: most of a 30 Hz camera's frames are passed over.

    ``read`` decodes it; ``path`` is the image file, if it has one of its own; ``time``, ``name``,
    ``dropped``, ``gap``, ``advance`` and ``clock`` are those of the ``Frame``. ``number`` is
    its row among all frames of the recording, with those that do not come; None if all come.
    """

    time: float | None
    name: str
    read: Callable[[], npt.NDArray[Any]]
    dropped: int = 0
    gap: bool = False
    path: str | None = None
    advance: float | None = None
    clock: float | None = None
    number: int | None = None

    def frame(self) -> Frame:
        """The frame, decoded. Call it before taking the next shot."""
        image = self.read()
        dropped, gap, advance = self.dropped, self.gap, self.advance
        return Frame(image, self.time, self.name, dropped, gap, advance, self.clock)


class Frames(ABC):
    """A source of ``Frame`` in the order in which they were taken. Each iteration begins anew.

    Attributes
    ----------
    timed : bool
        Whether frames have times.
    live : bool
        Whether frames come at their own pace: a slow reader loses some, and the end is not known.
    parallel : bool
        Whether shots may be read later, and by several threads.
    count : int or None
        The number of frames, if it is known; then ``len`` gives it too.
    """

    timed: bool = False
    live: bool = False
    parallel: bool = False
    _count: int | None = None
    _estimate: int | None = None
    _files: Sequence[str] = ()

    @abstractmethod
    def shots(self) -> Generator[Shot, None, None]:
        """The frames before they are decoded."""

    @property
    def count(self) -> int | None:
        """The number of frames; None if it is not known."""
        return self._count

    @property
    def total(self) -> int | None:
        """The number of frames of the newest iteration so far, with those that do not come: damaged
        ones, messages left out; None if it is not known, or the same.
        """
        return None

    @property
    def ready(self) -> npt.NDArray[Any] | None:
        """All frames, (n, dim), if they are ready descriptors in a file; else None."""
        return None

    @property
    def estimate(self) -> int | None:
        """About how many frames there are, for a progress bar; None if unknown."""
        return self._estimate if self.count is None else self.count

    @property
    def files(self) -> list[str]:
        """The files that are read, if they are known, in their order."""
        return list(self._files)

    @property
    def span(self) -> tuple[float, float] | None:
        """The first and the last time in seconds, if they are known beforehand."""
        return None

    @property
    def remarks(self) -> list[str]:
        """What was assumed, put in order or left out in the newest iteration so far, but for what
        the frames that these are made of say themselves.
        """
        return []

    def close(self) -> None:  # noqa: B027 (most do not wait)
        """Ends an iteration that waits for frames, from any thread."""

    def frames(self) -> Generator[Frame, None, None]:
        """Each frame, decoded. Its ``close`` releases files, cameras and threads at once."""
        with closing(self.shots()) as shots:
            for shot in shots:
                yield shot.frame()

    def __iter__(self) -> Iterator[Frame]:
        """Each frame, decoded."""
        return self.frames()

    def __len__(self) -> int:
        """The number of frames; a TypeError if it is not known."""
        if self.count is None:
            raise TypeError(f"{type(self).__name__}: the number of frames is not known beforehand")
        return self.count

    def __bool__(self) -> bool:
        """True: whether there are frames shows when they are read."""
        return True

    def __length_hint__(self) -> int:
        return self.estimate or 0


class IteratedFrames(Frames):
    """The frames of any iterable of them."""

    timed = True

    def __init__(self, source: Iterable[Frame]) -> None:
        self.source = source
        self._count = len(source) if isinstance(source, Sized) else None

    def shots(self) -> Generator[Shot, None, None]:
        """Each frame, which is decoded already."""
        for frame in self.source:
            image = partial(getattr, frame, "image")
            given = frame.advance, frame.clock
            yield Shot(frame.time, frame.name, image, frame.dropped, frame.gap, None, *given)


def added(moved: float | None, more: float | None) -> float | None:
    """The sum of two advances; None if one is unknown."""
    return None if moved is None or more is None else moved + more
