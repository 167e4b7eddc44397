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
from surefix.errors import SurefixFileError, SurefixValueError, mismatch
from surefix.frames.frame import Frames, Shot

# In the error of find_images for a folder or a pattern that is right and matches nothing.
NONE_YET = "found none"

LOG = logging.getLogger("surefix")


class FollowFrames(Frames):
    """The images of a folder or a pattern, present and future, in the order of their names.

    A file is taken once it is whole: its size and its time of writing do not change for ``settle``
    seconds, and it can be decoded. Those after it wait for it. The time of a frame is the time of
    its file's last change.

    A file that cannot be decoded and has not changed for 5 seconds is passed over: the logger
    ``surefix`` says so, on stderr by default, and it counts as dropped before the next.

    A file that comes late, after one with a later name, is taken when it comes; it has ``gap`` set,
    as has the one after it. A file that is removed before it was read counts as dropped.

    The folder is listed periodically rather than watched: that works on network drives and in
    containers too, which notices of changes do not reach.

    Parameters
    ----------
    place : str or path
        A folder, or a pattern like ``drive/*.jpg``.
    idle : float, optional
        The frames end when no new file has come for this many seconds; None waits for ever.
    settle : float
        In seconds. 0 if files appear whole, by renaming.
    poll : float
        Seconds between two listings.

    Raises
    ------
    SurefixFileError
        If there is no such folder.
    SurefixValueError
        For seconds below 0.
    """

    timed = True
    live = True
    # In seconds: the time that a file which cannot be decoded has to become whole.
    UNREADABLE_AFTER = 5.0

    def __init__(
        self,
        place: str | PathLike[str],
        *,
        idle: float | None = None,
        settle: float = 0.2,
        poll: float = 0.1,
    ) -> None:
        self.place = fspath(place)
        for name, value in (("idle", idle or 0.0), ("settle", settle), ("poll", poll)):
            if not (math.isfinite(value) and value >= 0):
                raise mismatch(name, "seconds, 0 or more", value)
        folder = Path(self.place)
        if not folder.is_dir() and not any(mark in self.place for mark in "*?["):
            raise SurefixFileError(f"{place}: cannot follow the folder: there is no such folder")
        self.idle, self.settle, self.poll = idle, settle, poll
        self._ended = Event()

    @property
    def files(self) -> list[str]:
        """The present ones."""
        return self._listed()

    def close(self) -> None:
        """Ends the iteration."""
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
            # Removed files need not be remembered.
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
                    read = partial(np.asarray, image)
                    yield Shot(written, Path(path).name, read, lost, order.breaks(path))
                    lost = 0
                news = time.monotonic()
            if self.idle is not None and time.monotonic() - news >= self.idle:
                return
            # The matcher gets most of the time, even if listing takes long.
            self._pause(max(self.poll, 0.0 if new else 4 * (time.monotonic() - begin)))

    def _pause(self, seconds: float) -> None:
        """Sleeps, or until the end. Not in ``Event.wait``: Ctrl-C there can leave it locked."""
        until = time.monotonic() + seconds
        while not self._ended.is_set() and (left := until - time.monotonic()) > 0:
            time.sleep(min(left, 0.05))

    def _when_whole(self, path: str) -> tuple[float, npt.NDArray[np.uint8]] | None:
        """The time of a file's last change and its image, once it is whole; None if it never is."""
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
                    if unchanged >= self.UNREADABLE_AFTER:
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
        """Whether a file does not follow on the one before: it, or the one before, is late."""
        here = self.rank[path]
        # A removed file has no rank.
        last = self.rank.get(self.last or "", -1)
        furthest = self.rank.get(self.furthest or "", -1)
        self.last = path
        if here > furthest:
            self.furthest = path
        return here < last or (last < furthest < here and last >= 0)
