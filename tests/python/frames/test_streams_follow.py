"""A folder that grows while it is read."""

import io
import os
import threading
import time
from collections.abc import Callable
from contextlib import closing
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import surefix
from recordings import pictures
from surefix.frames import FollowFrames, Frame, KeepNewest
from surefix.frames import open as frames_open

IMAGES = pictures(12)


def png(index: int) -> bytes:
    content = io.BytesIO()
    Image.fromarray(IMAGES[index]).save(content, "png")
    return content.getvalue()


class Writer(threading.Thread):
    """Writes files beside the reader; an error of its own comes out at the end."""

    def __init__(self, work: Callable[[], None]) -> None:
        super().__init__()
        self.work = work
        self.error: BaseException | None = None

    def run(self) -> None:
        try:
            self.work()
        except BaseException as error:
            self.error = error

    def __enter__(self) -> None:
        self.start()

    def __exit__(self, *_: object) -> None:
        self.join()
        if self.error is not None:
            raise self.error


def follow(place: Path, count: int) -> list[Frame]:
    """The first frames, however long they take."""
    stream = FollowFrames(place, idle=60, settle=0.1, poll=0.02)
    with closing(stream.frames()) as frames:
        return list(islice(frames, count))


def test_files_that_are_there_and_files_that_come_are_taken_in_order(tmp_path: Path) -> None:
    for index in range(4):
        (tmp_path / f"frame{index}.png").write_bytes(png(index))

    def camera() -> None:
        for index in range(4, 12):
            time.sleep(0.05)
            (tmp_path / f"frame{index}.png").write_bytes(png(index))
        (tmp_path / "notes.txt").write_text("not an image")

    with Writer(camera):
        frames = follow(tmp_path, 12)
    assert [frame.name for frame in frames] == [f"frame{index}.png" for index in range(12)]
    assert all(
        np.array_equal(frame.image, image) for frame, image in zip(frames, IMAGES, strict=True)
    )
    assert [frame.time for frame in frames] == [
        (tmp_path / frame.name).stat().st_mtime for frame in frames
    ]
    assert {(frame.dropped, frame.gap) for frame in frames} == {(0, False)}


@pytest.mark.parametrize("form", ["png", "jpeg", "bmp"])
def test_a_file_that_is_written_slowly_is_taken_whole_and_those_after_it_wait(
    tmp_path: Path, form: str
) -> None:
    content = io.BytesIO()
    Image.fromarray(IMAGES[0]).save(content, form)
    data = content.getvalue()

    def camera() -> None:
        with (tmp_path / f"0.{form}").open("wb") as file:
            for start in range(0, len(data), len(data) // 8):
                file.write(data[start : start + len(data) // 8])
                file.flush()
                time.sleep(0.06)
                if start == 0:
                    (tmp_path / "1.png").write_bytes(png(1))

    with Writer(camera):
        frames = follow(tmp_path, 2)
    assert [frame.name for frame in frames] == [f"0.{form}", "1.png"]
    assert np.array_equal(frames[0].image, surefix.read_image(tmp_path / f"0.{form}"))


def test_a_writer_that_pauses_in_a_file_is_waited_for(tmp_path: Path) -> None:
    def camera() -> None:
        with (tmp_path / "0.png").open("wb") as file:
            file.write(png(0)[:300])
            file.flush()
            # Much longer than it takes to settle.
            time.sleep(0.6)
            file.write(png(0)[300:])

    with Writer(camera):
        (frame,) = follow(tmp_path, 1)
    assert np.array_equal(frame.image, IMAGES[0])


def test_a_file_that_never_becomes_an_image_is_named_once_and_counts_as_dropped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(FollowFrames, "UNREADABLE_AFTER", 0.3)
    for index in range(6):
        (tmp_path / f"{index}.png").write_bytes(png(index))
    (tmp_path / "1.png").write_bytes(png(1)[:300])
    (tmp_path / "3.png").write_bytes(b"")
    (tmp_path / "4.png").write_bytes(b"not an image")
    frames = list(FollowFrames(tmp_path, idle=0.5, settle=0.1, poll=0.02))
    assert [(frame.name, frame.dropped, frame.gap) for frame in frames] == [
        ("0.png", 0, False),
        ("2.png", 1, False),
        ("5.png", 2, False),
    ]
    for record, name in zip(caplog.records, ("1.png", "3.png", "4.png"), strict=True):
        assert record.getMessage().startswith(f"Passed over: image {tmp_path / name}: ")
    # Without following it is an error.
    with pytest.raises(surefix.SurefixValueError, match=r"1\.png"):
        list(frames_open(tmp_path))


def test_a_late_file_is_taken_and_breaks_the_drive_twice(tmp_path: Path) -> None:
    for index in (1, 2, 5, 6):
        (tmp_path / f"{index}.png").write_bytes(png(index))
    stream = iter(FollowFrames(tmp_path, idle=1, settle=0, poll=0.02))
    seen = [next(stream) for _ in range(4)]
    for index in (3, 4, 7, 8):
        (tmp_path / f"{index}.png").write_bytes(png(index))
    seen += list(stream)
    assert [frame.name[0] for frame in seen] == list("12563478")
    assert [frame.name[0] for frame in seen if frame.gap] == ["3", "7"]


def test_a_file_that_is_gone_before_it_is_read_counts_as_dropped(tmp_path: Path) -> None:
    for index in range(6):
        (tmp_path / f"{index}.png").write_bytes(png(index))
    stream = iter(FollowFrames(tmp_path, idle=0.2, settle=0, poll=0.02))
    assert next(stream).name == "0.png"
    for index in (1, 2, 4):
        (tmp_path / f"{index}.png").unlink()
    rest = list(stream)
    assert [(frame.name, frame.dropped) for frame in rest] == [("3.png", 2), ("5.png", 1)]


def test_a_pattern_and_an_empty_folder_are_followed_too(tmp_path: Path) -> None:
    assert list(FollowFrames(tmp_path, idle=0.05)) == []

    def camera() -> None:
        for name in ("left0", "right0", "left1"):
            (tmp_path / f"{name}.png").write_bytes(png(0))

    with Writer(camera):
        frames = follow(tmp_path / "left*.png", 2)
    assert [frame.name for frame in frames] == ["left0.png", "left1.png"]


def test_close_ends_the_waiting(tmp_path: Path) -> None:
    stream = frames_open(tmp_path, follow=True)
    assert (type(stream), stream.live, stream.timed) == (FollowFrames, True, True)
    over = threading.Event()

    def stop() -> None:
        # Whenever the other thread has begun.
        while not over.wait(0.02):
            stream.close()

    with Writer(stop):
        try:
            frames = list(stream)
        finally:
            over.set()
    assert frames == []


def test_a_queue_wakes_a_stream_that_waits(tmp_path: Path) -> None:
    (tmp_path / "0.png").write_bytes(png(0))
    queue = KeepNewest(FollowFrames(tmp_path))
    stream = queue.frames()
    assert next(stream).name == "0.png"
    # No second file comes, ever: without a wake-up this would not return.
    stream.close()


def test_gaps_are_seen_in_the_times_of_writing(tmp_path: Path) -> None:
    for index, written in enumerate((100, 101, 109, 110)):
        (tmp_path / f"{index}.png").write_bytes(png(index))
        os.utime(tmp_path / f"{index}.png", (written, written))
    frames = list(frames_open(tmp_path, follow=True, idle=0.05, gap=2))
    assert [frame.time for frame in frames] == [100, 101, 109, 110]
    assert [frame.gap for frame in frames] == [False, False, True, False]


def test_no_folder_and_seconds_below_0_are_refused(tmp_path: Path) -> None:
    with pytest.raises(surefix.SurefixFileError, match=r"nowhere: cannot follow the folder"):
        FollowFrames(tmp_path / "nowhere")
    with pytest.raises(
        surefix.SurefixValueError, match="idle: expected seconds, 0 or more, got -1"
    ):
        FollowFrames(tmp_path, idle=-1)
