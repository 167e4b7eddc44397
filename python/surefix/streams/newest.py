"""Between a source that does not wait and a reader that is now and then slow: a short queue that
keeps the newest.
"""

import threading
import time
from collections import deque
from collections.abc import Generator, Iterable, Iterator
from contextlib import closing, suppress
from dataclasses import replace
from functools import partial
from queue import Empty, SimpleQueue

from surefix.errors import SurefixValueError
from surefix.streams.frame import Frame
from surefix.streams.stream import Derived, Shot, Stream

__all__ = ["KeepNewest"]


class KeepNewest(Derived):
    """The frames of a source, read in a thread of its own, of which a slow reader gets the newest.

    The source never waits. Where the queue is full the oldest frame in it is dropped, and the next
    one says how many were (``Frame.dropped``): the drive is broken there. At the end of the source
    the frames in the queue still come, and then its error, if it had one. The thread ends with the
    iteration, however that ends; where the loop is left by an error of its own, ``close`` ends it
    at once, and the end of the iterator's life at the latest. Only a source that gives no frame for
    5 seconds and has no ``close`` keeps its thread until it does.

    Parameters ---------- source : iterable of Frame Read in the thread. A ``Stream`` that waits for
    frames, such as ``FollowStream``, is woken by its ``close``. size : int How many frames wait at
    most.

    Attributes
    ----------
    dropped : int
        How many frames were dropped in the newest iteration, so far.

    Raises
    ------
    SurefixValueError
        For a size below 1.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.streams import Frame, KeepNewest
    >>> camera = KeepNewest([Frame(np.zeros((4, 6), np.uint8), None, str(index)) for index in range(9)])
    >>> frames = list(camera)
    >>> frames[-1].name, len(frames) + camera.dropped
    ('8', 9)
    """

    def __init__(self, source: Iterable[Frame], size: int = 1) -> None:
        if size < 1:
            raise SurefixValueError(f"size: expected 1 or more, got {size}")
        super().__init__(source)
        self.size = size
        self.live = True
        self.dropped = 0
        self._running: list[_Queue] = []

    @property
    def estimate(self) -> int | None:
        """As the source says: those that are dropped are among them."""
        return self.source_estimate

    def close(self) -> None:
        """Ends the iterations that are under way, and their threads."""
        for queue in list(self._running):
            queue.stop()

    def shots(self) -> Generator[Shot, None, None]:
        """The newest frames."""
        with closing(self.frames()) as frames:
            for frame in frames:
                yield Shot(
                    frame.time,
                    frame.name,
                    partial(getattr, frame, "image"),
                    frame.dropped,
                    frame.gap,
                )

    def frames(self) -> Generator[Frame, None, None]:
        """Each frame that the queue kept."""
        queue = _Queue(self.source, self.size)
        self.dropped = 0
        self._running.append(queue)
        queue.thread.start()
        try:
            while (frame := queue.take()) is not None:
                self.dropped += frame.dropped
                yield frame
        finally:
            queue.stop()
            self._running.remove(queue)


class _Queue:
    """The newest frames of one iteration, and the thread that brings them."""

    # Seconds. A wait without an end cannot be interrupted on every system.
    PATIENCE = 0.5
    # Seconds. A camera whose network is gone gives no frame and cannot be told to stop.
    FAREWELL = 5.0

    def __init__(self, source: Iterable[Frame], size: int) -> None:
        self.source = source
        self.frames: deque[Frame] = deque()
        self.size = size
        self.error: BaseException | None = None
        self.ended = self.stopped = False
        self.lock = threading.Lock()
        # Holds something where there may be news. (No condition: where Ctrl-C comes in the middle
        # of a wait for one, its lock can be left as it must not be.)
        self.news: SimpleQueue[None] = SimpleQueue()
        self.thread = threading.Thread(target=self._read, name="surefix-newest", daemon=True)

    def take(self) -> Frame | None:
        """The oldest frame that waits; None at the end."""
        while True:
            with self.lock:
                if self.frames:
                    return self.frames.popleft()
                if self.ended:
                    break
            with suppress(Empty):
                self.news.get(timeout=self.PATIENCE)
        if self.error is not None and not self.stopped:
            raise self.error
        return None

    def stop(self) -> None:
        """Ends the thread."""
        self.stopped = True
        # More than once: a source that is only beginning forgets that it was closed.
        until = time.monotonic() + self.FAREWELL
        while self.thread.is_alive() and time.monotonic() < until:
            if isinstance(self.source, Stream):
                self.source.close()
            self.thread.join(0.05)

    def _read(self) -> None:
        try:
            frames = iter(self.source)
            if isinstance(frames, Generator):
                with closing(frames):
                    self._put_all(frames)
            else:
                self._put_all(frames)
        except BaseException as error:  # Whatever it is, the reader is to have it.
            self.error = error
        finally:
            with self.lock:
                self.ended = True
            self.news.put(None)

    def _put_all(self, frames: Iterator[Frame]) -> None:
        for frame in frames:
            if self.stopped:
                return
            self._put(frame)

    def _put(self, frame: Frame) -> None:
        with self.lock:
            if len(self.frames) == self.size:
                lost = self.frames.popleft()
                after = self.frames.popleft() if self.frames else frame
                heir = replace(
                    after, dropped=after.dropped + lost.dropped + 1, gap=after.gap or lost.gap
                )
                if after is frame:
                    frame = heir
                else:
                    self.frames.appendleft(heir)
            self.frames.append(frame)
        if self.news.empty():
            self.news.put(None)
