"""Frames from a folder that grows while it is read."""

import logging
import math
import time
from collections.abc import Generator
from functools import partial
from os import PathLike, fspath, stat
from pathlib import Path
from threading import Event

import numpy as np
import numpy.typing as npt

from surefix._core import find_images, read_image
from surefix.errors import SurefixFileError, SurefixValueError
from surefix.streams.stream import Shot, Stream

__all__ = ["FollowStream"]

# In the error of find_images for a folder or a pattern that is right and matches nothing.
NONE_YET = "found none"

LOG = logging.getLogger("surefix")


class FollowStream(Stream):
    """The images of a folder or a pattern, those that are there and those that come, in the order
    of their names.

    A file is taken once it is whole: its size and its time of writing stay as they are for
    ``settle`` seconds, and it can be decoded. Those after it wait for it. The time of a frame is
    when its file was last written.

    A file that cannot be decoded and has not changed for 5 seconds is passed over: the logger
    ``surefix`` says so, on stderr by default, and it counts as dropped before the next.

    A file that comes after one with a later name was taken is taken when it comes; it says ``gap``,
    as does the one after it. One that is gone before it was read counts as dropped.

    The folder is listed again and again rather than watched: that works on network drives too, and
    in containers, where notices of changes do not reach.

    Parameters
    ----------
    place : str or path
        A folder, or a pattern like ``drive/*.jpg``.
    idle : float, optional
        The stream ends when no new file has come for so many seconds; None waits for ever.
    settle : float
        In seconds. 0 where files appear whole, by renaming.
    poll : float
        How often to look, in seconds.

    Raises
    ------
    SurefixFileError
        Where there is no such folder.
    SurefixValueError
        For seconds below 0.
    """

    timed = True
    live = True
    # How long a file that cannot be decoded may still become whole, in seconds: a writer that is
    # interrupted.
    PATIENCE = 5.0

    def __init__(
        self,
        place: str | PathLike[str],
        *,
        idle: float | None = None,
        settle: float = 0.2,
        poll: float = 0.1,
    ) -> None:
        self.place = fspath(place)
        for name, value in (
            ("idle", 0.0 if idle is None else idle),
            ("settle", settle),
            ("poll", poll),
        ):
            if not (math.isfinite(value) and value >= 0):
                raise SurefixValueError(f"{name}: expected seconds, 0 or more, got {value}")
        folder = Path(self.place)
        if not folder.is_dir() and not any(mark in self.place for mark in "*?["):
            raise SurefixFileError(f"{place}: cannot follow the folder: there is no such folder")
        self.idle, self.settle, self.poll = idle, settle, poll
        self._ended = Event()

    @property
    def files(self) -> list[str]:
        """Those that are there."""
        return self._listed()

    def close(self) -> None:
        """Ends the waiting: the iteration under way ends."""
        self._ended.set()

    def shots(self) -> Generator[Shot, None, None]:
        """Each image, by its file's name."""
        self._ended.clear()
        taken: set[str] = set()
        order = _Order()
        lost, news = 0, time.monotonic()
        while not self._ended.is_set():
            begin = time.monotonic()
            listed = self._listed()
            # What is gone from the folder need not be remembered.
            taken.intersection_update(listed)
            new = [path for path in listed if path not in taken]
            order.rank = {path: index for index, path in enumerate(listed)} if new else {}
            for path in new:
                whole = self._when_whole(path)
                if self._ended.is_set():
                    return
                taken.add(path)
                if whole is None:
                    lost += 1
                else:
                    written, image = whole
                    yield Shot(
                        written,
                        Path(path).name,
                        partial(np.asarray, image),
                        lost,
                        order.breaks(path),
                    )
                    lost = 0
                news = time.monotonic()
            if self.idle is not None and time.monotonic() - news >= self.idle:
                return
            # Most of the time is the matcher's, even where listing takes long.
            self._pause(max(self.poll, 0.0 if new else 4 * (time.monotonic() - begin)))

    def _pause(self, seconds: float) -> None:
        """Sleeps for so long, or until the end.

        Not by waiting for the event: where Ctrl-C comes in the middle of that, its lock can be left
        as it must not be.
        """
        until = time.monotonic() + seconds
        while not self._ended.is_set() and (left := until - time.monotonic()) > 0:
            time.sleep(min(left, 0.05))

    def _when_whole(self, path: str) -> tuple[float, npt.NDArray[np.uint8]] | None:
        """When a file was last written, and its image, once it is whole; None where it is gone or
        never becomes one.
        """
        before, since = None, time.monotonic()
        while not self._ended.is_set():
            try:
                status = stat(path)
            except OSError:
                return None
            state = (status.st_size, status.st_mtime_ns)
            if state != before:
                before, since = state, time.monotonic()
            unchanged = time.monotonic() - since
            if unchanged >= self.settle or time.time() - status.st_mtime >= self.settle:
                try:
                    return status.st_mtime, read_image(path)
                except SurefixFileError:
                    if not Path(path).exists():
                        return None
                    raise
                except SurefixValueError as error:
                    if unchanged >= self.PATIENCE:
                        LOG.warning("Passed over: %s", error)
                        return None
            self._pause(max(self.poll, 0.001))
        return None

    def _listed(self) -> list[str]:
        try:
            return find_images(self.place)
        except SurefixValueError as error:
            if NONE_YET in str(error):
                return []
            raise


class _Order:
    """Whether files come in the order of their names."""

    def __init__(self) -> None:
        self.rank: dict[str, int] = {}
        self.last: str | None = None
        self.furthest: str | None = None

    def breaks(self, path: str) -> bool:
        """Whether a file does not follow on the one before, as a late one does not, nor what comes
        after it.
        """
        here = self.rank[path]
        # One that is gone from the folder has no rank: nothing can be said.
        last = self.rank.get(self.last or "", -1)
        furthest = self.rank.get(self.furthest or "", -1)
        self.last = path
        if here > furthest:
            self.furthest = path
        return here < last or (last < furthest < here and last >= 0)
