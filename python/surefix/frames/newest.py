"""A short queue between a source that does not wait and a slow reader: it keeps the newest."""

import threading
import time
from collections import deque
from collections.abc import Generator, Iterable
from contextlib import closing, nullcontext, suppress
from dataclasses import replace
from queue import Empty, SimpleQueue

from surefix.errors import mismatch
from surefix.frames.frame import Frame, Frames, IteratedFrames, Shot
from surefix.frames.sampling import Derived


class KeepNewest(Derived):
    """The frames of a source, read in a thread of its own; a slow reader gets the newest.

    The source never waits. If the queue is full, its oldest frame is dropped, and the next one
    counts it (``Frame.dropped``): the drive is broken there. At the end of the source the queued
    frames still come, then its error, if it had one. The thread ends with the iteration, however
    that ends; if the loop ends by an error of its own, ``close`` ends the thread at once, and the
    end of the iterator's life at the latest. Only a source that gives no frame for 5 seconds and
    has no ``close`` keeps its thread until it does.

    Parameters
    ----------
    source : iterable of Frame
        Read in the thread. ``Frames`` that wait, such as ``FollowFrames``, are woken by their
        ``close``.
    size : int
        The most frames that wait.

    Attributes
    ----------
    dropped : int
        The number of frames dropped in the newest iteration so far.

    Raises
    ------
    SurefixValueError
        If the size is below 1.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.frames import Frame, KeepNewest
    >>> image = np.zeros((4, 6), np.uint8)
    >>> camera = KeepNewest([Frame(image, None, str(index)) for index in range(9)])
    >>> frames = list(camera)
    >>> frames[-1].name, len(frames) + camera.dropped
    ('8', 9)
    """

    def __init__(self, source: Iterable[Frame], size: int = 1) -> None:
        if size < 1:
            raise mismatch("size", "1 or more", size)
        super().__init__(source)
        self.size, self._given = size, source
        # Dropped frames included.
        self._estimate = self.source.estimate
        self.live, self.parallel = True, False
        self.dropped = 0
        self._running: list[_Queue] = []

    def close(self) -> None:
        """Ends the running iterations and their threads."""
        for queue in list(self._running):
            queue.stop()

    def shots(self) -> Generator[Shot, None, None]:
        """The newest frames."""
        with closing(self.frames()) as frames:
            yield from IteratedFrames(frames).shots()

    def frames(self) -> Generator[Frame, None, None]:
        """Each frame that the queue kept."""
        queue = _Queue(self._given, self.size)
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
    """The newest frames of one iteration, and the thread that reads them."""

    # In seconds. A wait without an end cannot be interrupted on every system.
    POLL = 0.5
    # In seconds. A camera whose network is gone gives no frame and cannot be told to stop.
    JOIN_TIMEOUT = 5.0

    def __init__(self, source: Iterable[Frame], size: int) -> None:
        self.source = source
        self.frames: deque[Frame] = deque()
        self.size = size
        self.error: BaseException | None = None
        self.ended = self.stopped = False
        self.lock = threading.Lock()
        # Holds an item if there may be a new frame. Not a condition: Ctrl-C in the middle of a wait
        # can leave a condition's lock in a wrong state.
        self.news: SimpleQueue[None] = SimpleQueue()
        self.thread = threading.Thread(target=self._read, name="surefix-newest", daemon=True)

    def take(self) -> Frame | None:
        """The oldest queued frame; None at the end."""
        while True:
            with self.lock:
                if self.frames:
                    return self.frames.popleft()
                if self.ended:
                    break
            with suppress(Empty):
                self.news.get(timeout=self.POLL)
        if self.error is not None and not self.stopped:
            raise self.error
        return None

    def stop(self) -> None:
        """Ends the thread."""
        self.stopped = True
        # More than once: a source that only begins forgets that it was closed.
        until = time.monotonic() + self.JOIN_TIMEOUT
        while self.thread.is_alive() and time.monotonic() < until:
            if isinstance(self.source, Frames):
                self.source.close()
            self.thread.join(0.05)

    def _read(self) -> None:
        try:
            frames = iter(self.source)
            with closing(frames) if isinstance(frames, Generator) else nullcontext():
                for frame in frames:
                    if self.stopped:
                        break
                    self._put(frame)
        except BaseException as error:  # The reader gets it.
            self.error = error
        finally:
            with self.lock:
                self.ended = True
            self.news.put(None)

    def _put(self, frame: Frame) -> None:
        with self.lock:
            self.frames.append(frame)
            if len(self.frames) > self.size:
                lost, after = self.frames.popleft(), self.frames.popleft()
                dropped, gap = after.dropped + lost.dropped + 1, after.gap or lost.gap
                self.frames.appendleft(replace(after, dropped=dropped, gap=gap))
        if self.news.empty():
            self.news.put(None)
