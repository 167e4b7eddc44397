"""Videos in bags: a packet a message."""

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

import surefix
from recordings import Bag, UInt8, packets, pictures
from surefix.frames import BagFrames, Frames
from surefix.frames import open as frames_open

IMAGES = pictures(25)
START = 1_700_000_000.0


def write(
    folder: Path,
    video: list[tuple[int, bytes]],
    form: str = "h264",
    kind: str = "CompressedVideo",
    bag_kind: str = "mcap",
) -> Path:
    with Bag(folder, bag_kind) as bag:
        # Packets are sent in the order of their decoding.
        for at, (number, data) in enumerate(video):
            bag.video("/camera/video", data, form, START + number / 8, kind, START + at / 8)
    return bag.path


def shown(source: Frames, images: list[UInt8] = IMAGES) -> list[int]:
    """The number of the picture that each frame is nearest to, and near enough."""
    found = []
    for frame in source:
        off = [np.abs(frame.image.astype(int) - image).mean() for image in images]
        found.append(int(np.argmin(off)))
        assert min(off) < 12
    return found


@pytest.mark.parametrize(
    ("codec", "form", "kind"),
    [
        ("libx264", "h264", "CompressedVideo"),
        ("libx265", "h265", "CompressedVideo"),
        ("libx264", "h264", "CompressedImage"),
        ("libx264", "H.264", "CompressedImage"),
        # A driver that does not know what it sends.
        ("libx264", "jpeg", "CompressedImage"),
        ("libx265", "hevc", "CompressedImage"),
        ("libx264", "libx264", "FFMPEGPacket"),
        ("libx264", "h264;bgr8;bgr8;bgr8", "FFMPEGPacket"),
        ("libx265", "hevc", "FFMPEGPacket"),
    ],
)
def test_videos_are_decoded(tmp_path: Path, codec: str, form: str, kind: str) -> None:
    options = {"x265-params": "log-level=none"} if codec == "libx265" else {}
    path = write(tmp_path, packets(IMAGES, codec, **options), form, kind)
    source = frames_open(path)
    assert shown(source) == [*range(25)]
    frames = list(source)
    assert [frame.time for frame in frames] == [START + number / 8 for number in range(25)]
    assert [frame.name for frame in frames] == [str(number) for number in range(25)]
    assert source.remarks == []
    assert shown(frames_open(path, stride=5)) == [0, 5, 10, 15, 20]


def test_pictures_that_are_sent_out_of_order_are_put_in_order(tmp_path: Path) -> None:
    video = packets(IMAGES, bf="3", preset="medium")
    assert [number for number, _ in video] != [*range(25)]
    source = frames_open(write(tmp_path, video))
    assert shown(source) == [*range(25)]
    times = [frame.time for frame in source]
    assert times == [START + number / 8 for number in range(25)]


def test_what_comes_before_the_first_key_frame_is_left_out_and_said(tmp_path: Path) -> None:
    source = frames_open(write(tmp_path, packets(IMAGES)[4:]))
    assert shown(source) == [*range(10, 25)]
    assert source.remarks == ["6 messages before the first key frame left out"]


@pytest.mark.parametrize("damage", ["lost", "zeros", "cut"])
def test_after_a_damaged_packet_the_next_key_frame_goes_on(tmp_path: Path, damage: str) -> None:
    video = packets(IMAGES)
    number, data = video[13]
    broken = {"lost": b"", "zeros": data[:6] + bytes(len(data) - 6), "cut": data[: len(data) // 2]}
    video[13] = number, broken[damage]
    source = BagFrames(write(tmp_path, video), skip_bad=True)
    frames = list(source)
    names = [int(frame.name) for frame in frames]
    assert names == [*range(13), *range(20, 25)]
    assert [frame.dropped for frame in frames] == [0] * 13 + [7] + [0] * 4
    assert len(source.bad) == 7
    assert "/camera/video, message 13: " in source.bad[0]


def test_a_video_without_a_key_frame_is_an_error(tmp_path: Path) -> None:
    path = write(tmp_path, packets(IMAGES)[1:9])
    expected = r"/camera/video: expected a picture that can be decoded, got none in 8 messages"
    with pytest.raises(surefix.SurefixValueError, match=expected):
        list(frames_open(path))


def test_a_codec_that_is_not_known_is_named(tmp_path: Path) -> None:
    path = write(tmp_path, packets(IMAGES)[:2], "wavelets")
    with pytest.raises(surefix.SurefixValueError, match=r"expected a video of h264, .*'wavelets'"):
        list(frames_open(path))


def test_packets_in_a_bag_that_does_not_define_its_messages(tmp_path: Path) -> None:
    path = write(tmp_path, packets(IMAGES), "libx264", "FFMPEGPacket", "sqlite3")
    (file,) = path.glob("*.db3")
    with closing(sqlite3.connect(file)) as database, database:
        database.execute("DELETE FROM message_definitions")
    assert shown(frames_open(path)) == [*range(25)]
