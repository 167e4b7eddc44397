"""Small grey pictures of frames that pass by, for the map that is made of them."""

from collections.abc import Callable, Generator, Sequence
from contextlib import closing, suppress
from dataclasses import replace
from operator import index as as_index
from threading import Lock
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix._core import thumbnail
from surefix.errors import mismatch
from surefix.frames.frame import Frames, Shot
from surefix.frames.levels import Levels
from surefix.frames.pillow import pixels_of
from surefix.frames.sampling import Derived

UInt8 = npt.NDArray[np.uint8]
# True, or width and height.
Wanted = bool | Sequence[int]


def size_of(wanted: Wanted) -> tuple[int, int] | None:
    """Width and height, if they are given."""
    if isinstance(wanted, (bool, np.bool_)):
        return None
    with suppress(TypeError, ValueError):
        width, height = map(as_index, wanted)
        if width > 0 and height > 0:
            return width, height
    raise mismatch("thumbnails", "True, or a width and a height above 0", repr(wanted))


class Pictured(Derived):
    """The frames of a source; of each one that is read, a small picture is kept."""

    def __init__(self, source: Frames, wanted: Wanted, levels: Levels | None) -> None:
        super().__init__(source)
        self.parallel = source.parallel
        self._count, self._estimate = source.count, source.estimate
        self._size = size_of(wanted)
        self._levels = levels
        self._made: dict[int, UInt8] = {}
        # Of files: a cache may know them without reading them.
        self._unread: dict[int, Callable[[], Any]] = {}
        self._lock = Lock()

    def shots(self) -> Generator[Shot, None, None]:
        """Those of the source."""
        with closing(self.source.shots()) as shots:
            for index, shot in enumerate(shots):
                if shot.path is not None:
                    self._unread[index] = shot.read
                yield replace(shot, read=self._reader(index, shot.read))

    def pictures(self, count: int, bad: set[int] | None) -> UInt8:
        """Those of the ``count`` frames that are not bad: (n, height, width)."""
        missing = bad or set()
        indices = [index for index in range(count + len(missing)) if index not in missing]
        for index in indices:
            if index not in self._made:
                self._keep(index, self._unread[index]())
        return np.stack([self._made[index] for index in indices])

    def _reader(self, index: int, read: Callable[[], Any]) -> Callable[[], Any]:
        def reads() -> Any:
            image = read()
            self._keep(index, image)
            return image

        return reads

    def _keep(self, index: int, given: Any) -> None:
        image = pixels_of(given)
        with self._lock:
            if self._size is None:
                # All have that of the first.
                height, width = thumbnail(image, None, self._levels).shape
                self._size = width, height
        picture = thumbnail(image, self._size, self._levels)
        with self._lock:
            self._made[index] = picture
            self._unread.pop(index, None)
