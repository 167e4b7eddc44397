"""The queue that keeps the newest frame."""

import gc
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest

import surefix
from surefix.frames import Frame, KeepNewest, Stride

BLACK = np.zeros((4, 6), np.uint8)


def frames(count: int) -> list[Frame]:
    return [Frame(BLACK, float(index), str(index)) for index in range(count)]


def threads() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "surefix-newest"]


@pytest.fixture(autouse=True)
def no_thread_is_left_over() -> Iterator[None]:
    yield
    gc.collect()
    assert threads() == []


class Paced:
    """A source that says when it has given its frames: it must never wait for the reader."""

    def __init__(self, given: list[Frame]) -> None:
        self.given = given
        self.done = threading.Event()

    def __iter__(self) -> Iterator[Frame]:
        yield from self.given
        self.done.set()


@pytest.mark.parametrize("size", [1, 2, 5])
def test_the_source_never_waits_and_the_newest_are_kept(size: int) -> None:
    source = Paced(frames(50))
    queue = KeepNewest(source, size)
    with closing(queue.frames()) as stream:
        first = next(stream)
        # The reader is busy here, for as long as it takes.
        assert source.done.wait(30)
        rest = list(stream)
    seen = [first, *rest]
    assert [frame.name for frame in seen[-size:]] == [str(index) for index in range(50 - size, 50)]
    assert len(seen) + sum(frame.dropped for frame in seen) == 50
    assert queue.dropped == 50 - len(seen)


@pytest.mark.parametrize("seed", range(20))
def test_every_frame_is_either_given_or_counted_before_the_next(seed: int) -> None:
    generator = np.random.default_rng(seed)
    pauses = generator.choice([0, 0, 0, 0.002], 40)
    lost = generator.choice([0, 0, 3], 40)
    gaps = generator.random(40) < 0.1

    def camera() -> Iterator[Frame]:
        for index, pause in enumerate(pauses):
            time.sleep(pause)
            yield Frame(BLACK, None, str(index), int(lost[index]), bool(gaps[index]))

    seen = []
    for frame in KeepNewest(camera(), int(generator.integers(1, 4))):
        seen.append(frame)
        time.sleep(float(generator.choice([0, 0.004])))
    at = [int(frame.name) for frame in seen]
    before = [-1, *at[:-1]]
    # The frames that the source itself had lost are counted too.
    between = [slice(a + 1, b + 1) for a, b in zip(before, at, strict=True)]
    assert at[-1] == 39
    expected = [
        b - a - 1 + int(lost[part].sum()) for a, b, part in zip(before, at, between, strict=True)
    ]
    assert [frame.dropped for frame in seen] == expected
    assert [frame.gap for frame in seen] == [bool(gaps[part].any()) for part in between]


def test_a_reader_that_keeps_up_loses_nothing() -> None:
    taken = threading.Semaphore(0)

    def camera() -> Iterator[Frame]:
        for frame in frames(30):
            yield frame
            taken.acquire()

    names = []
    queue = KeepNewest(camera())
    for frame in queue:
        names.append(frame.name)
        taken.release()
    assert names == [str(index) for index in range(30)]
    assert queue.dropped == 0


class UnpluggedError(Exception):
    """An error of the source's own."""


def test_an_error_of_the_source_comes_out_after_its_frames() -> None:
    def camera() -> Iterator[Frame]:
        yield frames(1)[0]
        raise UnpluggedError("the cable")

    stream = iter(KeepNewest(camera(), 3))
    assert next(stream).name == "0"
    with pytest.raises(UnpluggedError, match="the cable"):
        next(stream)
    assert list(stream) == []


def test_a_loop_that_is_left_ends_the_thread() -> None:
    closed = threading.Event()

    def camera() -> Iterator[Frame]:
        try:
            while True:
                yield frames(1)[0]
                time.sleep(0.001)
        finally:
            closed.set()

    for _ in KeepNewest(camera()):
        assert len(threads()) == 1
        break
    gc.collect()
    assert closed.wait(10)
    assert threads() == []


def test_close_ends_the_iteration_from_another_thread() -> None:
    def camera() -> Iterator[Frame]:
        while True:
            yield frames(1)[0]
            time.sleep(0.001)

    queue = KeepNewest(camera())
    closer = threading.Thread(target=queue.close)
    for _ in queue:
        if closer.ident is None:
            closer.start()
    closer.join()


def test_it_can_be_iterated_again_and_taken_from() -> None:
    queue = KeepNewest(frames(5), 5)
    for _ in range(2):
        assert [frame.name for frame in queue] == ["0", "1", "2", "3", "4"]
    assert [frame.name for frame in Stride(queue, 2)] == ["0", "2", "4"]


def test_a_size_of_0_is_refused() -> None:
    with pytest.raises(surefix.SurefixValueError, match="size: expected 1 or more, got 0"):
        KeepNewest([], 0)


WAITING = """
import time
from surefix.frames import KeepNewest, newest

def camera():
    print("waiting", flush=True)
    while True:
        time.sleep(0.01)
    yield

newest._Queue.JOIN_TIMEOUT = 0.1
try:
    for frame in KeepNewest(camera()):
        pass
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


def test_ctrl_c_reaches_a_reader_whose_camera_says_nothing() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", WAITING], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "waiting\n"
        time.sleep(0.2)
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=30)[0] == "interrupted\n"
        assert process.returncode == 0
