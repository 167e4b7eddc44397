"""Bags of ROS 1 and ROS 2, and MCAP files, as streams."""

import io
import re
import sqlite3
from array import array
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

import surefix
from recordings import KINDS, Bag, pictures
from surefix.datasets import demosaic
from surefix.frames import BagFrames, SkipBad, image_of, in_8_bits
from surefix.frames import open as frames_open

IMAGES = pictures(6)
# Exact in a float64, and in nanoseconds.
TIMES = [1_700_000_000 + index / 8 for index in range(6)]


@pytest.mark.parametrize("kind", KINDS)
def test_images_and_times_are_those_that_were_written(tmp_path: Path, kind: str) -> None:
    with Bag(tmp_path, kind) as bag:
        for image, time in zip(IMAGES, TIMES, strict=True):
            bag.image("/front/image_raw", image, time, recorded=time + 3)
            bag.pose("/odom", "nav_msgs/msg/Odometry", (time, 0, 0), time)
    stream = frames_open(bag.path)
    assert isinstance(stream, BagFrames)
    assert (stream.topic, len(stream), stream.timed) == ("/front/image_raw", 6, True)
    for _ in range(2):
        frames = list(stream)
        assert [frame.time for frame in frames] == TIMES
        assert [frame.name for frame in frames] == [str(index) for index in range(6)]
        assert all(
            np.array_equal(frame.image, image) for frame, image in zip(frames, IMAGES, strict=True)
        )
    assert [frame.name for frame in frames_open(bag.path, every=0.25)] == ["0", "2", "4"]


@pytest.mark.parametrize("ending", ["mcap", "db3"])
def test_a_file_of_a_ros2_bag_is_a_bag_by_itself(tmp_path: Path, ending: str) -> None:
    with Bag(tmp_path, "mcap" if ending == "mcap" else "sqlite3") as bag:
        bag.image("/image", IMAGES[0], TIMES[0])
    (file,) = bag.path.glob(f"*.{ending}")
    (frame,) = frames_open(file)
    assert np.array_equal(frame.image, IMAGES[0])


def test_a_bag_of_a_recorder_that_was_interrupted_is_read_by_its_files(tmp_path: Path) -> None:
    with Bag(tmp_path, "mcap") as bag:
        bag.image("/image", IMAGES[0], TIMES[0])
    (bag.path / "metadata.yaml").unlink()
    (frame,) = frames_open(bag.path)
    assert np.array_equal(frame.image, IMAGES[0])


def test_a_message_without_a_stamp_has_the_time_of_its_recording(tmp_path: Path) -> None:
    with Bag(tmp_path, "mcap") as bag:
        bag.image("/image", IMAGES[0], 0.0, recorded=TIMES[3])
    assert [frame.time for frame in frames_open(bag.path)] == [TIMES[3]]


@pytest.mark.parametrize("kind", KINDS)
def test_compressed_images_are_decoded_as_pillow_does(tmp_path: Path, kind: str) -> None:
    contents = []
    for form, options in (("png", {}), ("jpeg", {"quality": 95})):
        content = io.BytesIO()
        Image.fromarray(IMAGES[0]).save(content, form, **options)
        contents.append(content.getvalue())
    with Bag(tmp_path, kind) as bag:
        for content, form, time in zip(
            contents, ("rgb8; png compressed bgr8", "jpeg"), TIMES, strict=False
        ):
            bag.compressed("/front/compressed", content, form, time)
    png, jpeg = frames_open(bag.path)
    assert np.array_equal(png.image, IMAGES[0])
    pillow = np.asarray(Image.open(io.BytesIO(contents[1])), int)
    assert np.abs(jpeg.image - pillow).max() <= 3
    assert [png.time, jpeg.time] == TIMES[:2]


def message(
    data: npt.NDArray[np.generic], encoding: str, width: int, step: int = 0, big: int = 0
) -> SimpleNamespace:
    """As a sensor_msgs Image."""
    height = len(data)
    flat = np.frombuffer(data.tobytes(), np.uint8)
    step = step or len(flat) // height
    return SimpleNamespace(
        height=height, width=width, encoding=encoding, is_bigendian=big, step=step, data=flat
    )


@pytest.mark.parametrize("padding", [0, 5])
@pytest.mark.parametrize(
    ("encoding", "picked"),
    [
        ("mono8", [0]),
        ("8UC1", [0]),
        ("rgb8", [0, 1, 2]),
        ("bgr8", [2, 1, 0]),
        ("8UC3", [2, 1, 0]),
        ("rgba8", [0, 1, 2]),
        ("bgra8", [2, 1, 0]),
    ],
)
def test_encodings_of_8_bits_with_and_without_padded_rows(
    encoding: str, picked: list[int], padding: int
) -> None:
    samples = {"mono8": 1, "8UC1": 1, "rgba8": 4, "bgra8": 4}.get(encoding, 3)
    pixels = np.random.default_rng(1).integers(0, 256, (7, 9, samples), np.uint8)
    rows = np.pad(pixels.reshape(7, -1), ((0, 0), (0, padding)), constant_values=77)
    image = image_of(message(rows, encoding, 9))
    expected = pixels[..., picked]
    assert np.array_equal(image, expected[..., 0] if samples == 1 else expected)
    assert image.flags.c_contiguous


@pytest.mark.parametrize("big", [0, 1])
@pytest.mark.parametrize(
    ("encoding", "samples"), [("mono16", 1), ("16UC1", 1), ("rgb16", 3), ("bgr16", 3)]
)
def test_16_bits_are_scaled_as_in_an_image_file(
    tmp_path: Path, encoding: str, samples: int, big: int
) -> None:
    pixels = np.random.default_rng(2).integers(0, 65536, (7, 9, samples), np.uint16)
    rows = np.pad(
        pixels.astype(">u2" if big else "<u2").view(np.uint8).reshape(7, -1), ((0, 0), (0, 3))
    )
    image = image_of(message(rows, encoding, 9, big=big))
    # As the library reads a 16-bit PNG; OpenCV writes colour as BGR.
    stored = pixels[..., ::-1] if encoding == "rgb16" else pixels
    assert cv2.imwrite(str(tmp_path / "deep.png"), stored)
    assert image.dtype == np.uint16
    assert np.array_equal(image, surefix.read_image(tmp_path / "deep.png"))


@pytest.mark.parametrize("pattern", ["rggb", "grbg", "gbrg", "bggr"])
@pytest.mark.parametrize("bits", [8, 16])
def test_a_bayer_mosaic_becomes_a_colour_image(pattern: str, bits: int) -> None:
    mosaic = np.random.default_rng(3).integers(0, 256, (6, 8), np.uint8)
    # 257 times a byte is the same shade in 16 bits.
    rows = mosaic if bits == 8 else (mosaic.astype("<u2") * 257)
    image = image_of(message(rows, f"bayer_{pattern}{bits}", 8))
    image = in_8_bits(image)
    assert np.array_equal(image, demosaic(mosaic, pattern))  # type: ignore[arg-type]
    colours = dict(
        zip(pattern, (mosaic[0, 0], mosaic[0, 1], mosaic[1, 0], mosaic[1, 1]), strict=True)
    )
    assert (image[0, 0, 0], image[0, 0, 2]) == (colours["r"], colours["b"])


@pytest.mark.parametrize(
    ("encoding", "conversion"),
    [("uyvy", "Y"), ("yuv422", "Y"), ("yuyv", "2"), ("yuv422_yuy2", "2")],
)
def test_of_yuv_the_brightness_is_taken(encoding: str, conversion: str) -> None:
    pixels = np.random.default_rng(4).integers(0, 256, (6, 8, 2), np.uint8)
    code = cv2.COLOR_YUV2GRAY_UYVY if conversion == "Y" else cv2.COLOR_YUV2GRAY_YUY2
    assert np.array_equal(image_of(message(pixels, encoding, 8)), cv2.cvtColor(pixels, code))


@pytest.mark.parametrize("holder", [bytes, bytearray, lambda data: array("B", data), memoryview])
def test_the_bytes_of_any_ros_library_are_taken(holder: type[bytes]) -> None:
    pixels = IMAGES[0]
    given = message(pixels, "rgb8", pixels.shape[1])
    given.data = holder(pixels.tobytes())
    assert np.array_equal(image_of(given), pixels)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"encoding": "theora"}, "expected an encoding among mono8, .*, got 'theora'"),
        ({"step": 5}, "expected 48 rows of 192 bytes or more .*got a row step of 5 and 9216 bytes"),
        ({"height": 49}, "expected 49 rows"),
        ({"height": 0}, "expected 0 rows"),
        ({"encoding": "bayer_rggb8", "width": 63, "step": 192}, "even number of pixels"),
    ],
)
def test_an_image_that_does_not_fit_is_named(change: dict[str, object], words: str) -> None:
    given = message(IMAGES[0], "rgb8", 64)
    vars(given).update(change)
    with pytest.raises(surefix.SurefixValueError, match=words) as refused:
        image_of(given, "drive.bag, /image, message 7")
    assert str(refused.value).startswith("drive.bag, /image, message 7: ")


def test_a_damaged_image_in_a_bag_is_passed_over_and_said(tmp_path: Path) -> None:
    content = io.BytesIO()
    Image.fromarray(IMAGES[0]).save(content, "png")
    with Bag(tmp_path, "mcap") as bag:
        for index in range(4):
            data = content.getvalue() if index != 2 else b"\x89PNG not really"
            bag.compressed("/image", data, "png", TIMES[index])
    source = frames_open(bag.path, skip_bad=True)
    assert isinstance(source, SkipBad)
    frames = list(source)
    assert [(frame.name, frame.dropped) for frame in frames] == [("0", 0), ("1", 0), ("3", 1)]
    (bad,) = source.bad
    assert "drive_mcap, /image, message 2: " in bad
    stream = iter(frames_open(bag.path))
    assert [next(stream).name for _ in range(2)] == ["0", "1"]
    with pytest.raises(surefix.SurefixValueError, match=r"drive_mcap, /image, message 2: "):
        next(stream)


@pytest.mark.parametrize("count", [3, 15])
def test_a_bag_of_which_no_image_can_be_decoded_is_an_error(tmp_path: Path, count: int) -> None:
    with Bag(tmp_path, "mcap") as bag:
        for index in range(count):
            bag.compressed("/image", b"no picture", "png", 1.0 + index)
    with pytest.raises(surefix.SurefixValueError, match=r"/image, message 0: "):
        list(frames_open(bag.path, skip_bad=True))


def test_depth_is_no_camera_image() -> None:
    with pytest.raises(surefix.SurefixValueError, match="got a depth image"):
        image_of(SimpleNamespace(format="16UC1; compressedDepth png", data=b"12345678"))


def test_the_topic_is_asked_for_where_there_are_several(tmp_path: Path) -> None:
    with Bag(tmp_path, "ros1") as bag:
        for index, time in enumerate(TIMES):
            bag.image("/left", IMAGES[0], time)
            if index < 2:
                bag.image("/right", IMAGES[1], time)
            bag.pose("/odom", "nav_msgs/msg/Odometry", (0, 0, 0), time)
    listed = (
        r"/left \(sensor_msgs/msg/Image, 6 messages\), /right \(sensor_msgs/msg/Image, 2 messages\)"
    )
    sized = listed.replace(r"\)", r", 64 x 48, rgb8\)")
    with pytest.raises(surefix.SurefixValueError, match=f"there are several: {sized}"):
        frames_open(bag.path)
    for wrong in ("/front", "/odom"):
        with pytest.raises(surefix.SurefixValueError, match=f"one of {listed}, got '{wrong}'"):
            frames_open(bag.path, topic=wrong)
    right = frames_open(bag.path, topic="/right")
    assert len(right) == len(list(right)) == 2
    assert np.array_equal(next(iter(right)).image, IMAGES[1])


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_without_images_lists_what_it_has(tmp_path: Path, kind: str) -> None:
    with Bag(tmp_path, kind) as bag:
        bag.pose("/odom", "nav_msgs/msg/Odometry", (0, 0, 0), TIMES[0])
    with pytest.raises(
        surefix.SurefixValueError,
        match=r"a topic of images \(sensor_msgs/msg/Image, .*, got /odom \(nav_msgs/msg/Odometry",
    ):
        frames_open(bag.path)


@pytest.mark.parametrize("content", [None, b"", b"hello", "cut"])
@pytest.mark.parametrize("ending", ["bag", "mcap", "db3"])
def test_what_is_no_bag_is_refused(
    tmp_path: Path, ending: str, content: bytes | str | None
) -> None:
    path = tmp_path / f"drive.{ending}"
    if content == "cut":
        kind = {"bag": "ros1", "mcap": "mcap", "db3": "sqlite3"}[ending]
        with Bag(tmp_path, kind, f"whole{'.bag' * (kind == 'ros1')}") as bag:
            for image, time in zip(IMAGES, TIMES, strict=True):
                bag.image("/image", image, time)
        file = bag.path if kind == "ros1" else next(bag.path.glob(f"*.{ending}"))
        path.write_bytes(file.read_bytes()[:-3000])
    elif isinstance(content, bytes):
        path.write_bytes(content)
    kind_of_error = surefix.SurefixFileError if content is None else surefix.SurefixValueError
    with pytest.raises(kind_of_error, match=rf"drive\.{ending}"):
        list(frames_open(path))
    if (ending, content) == ("db3", "cut"):
        # Its pages are read as far as they go.
        source = BagFrames(path, skip_bad=True)
        assert len(list(source)) == 5
        assert "the last 1 message of /image cannot be read" in source.remarks[0]
        return
    with pytest.raises(kind_of_error, match=rf"drive\.{ending}") as refused:
        list(frames_open(path, skip_bad=True))
    if content == "cut":
        tool = {"bag": "rosbag reindex", "mcap": "mcap recover"}[ending]
        assert str(refused.value).endswith(f"if its recorder was interrupted: {tool}")


def test_a_bag_damaged_in_its_middle_keeps_what_came_before(tmp_path: Path) -> None:
    with Bag(tmp_path, "ros1") as bag:
        for image, time in zip(pictures(40), np.arange(40) / 8 + TIMES[0], strict=True):
            bag.image("/image", image, float(time))
    data = bytearray(bag.path.read_bytes())
    # The length of a message's encoding becomes nonsense.
    at = data.rindex(b"rgb8") - 4
    data[at : at + 4] = b"\xff\xff\xff\x7f"
    bag.path.write_bytes(data)
    source = BagFrames(bag.path, skip_bad=True)
    assert [frame.name for frame in source] == [str(index) for index in range(39)]
    assert len(source) == 39
    assert re.search(r"drive\.bag, /image, message 39: a damaged bag: ", source.bad[0])
    stream = iter(BagFrames(bag.path))
    assert [next(stream).name for _ in range(39)] == [str(index) for index in range(39)]
    with pytest.raises(surefix.SurefixValueError, match=r"drive\.bag, /image, message 39"):
        next(stream)


def test_damaged_messages_count_as_dropped(tmp_path: Path) -> None:
    with Bag(tmp_path, "mcap") as bag:
        for index in range(6):
            size = (999, 64) if index in (2, 3) else None
            step = None if size is None else 192
            bag.image("/image", IMAGES[index], TIMES[index], size=size, step=step)
    source = BagFrames(bag.path, skip_bad=True)
    assert [(frame.name, frame.dropped) for frame in source] == [
        ("0", 0),
        ("1", 0),
        ("4", 2),
        ("5", 0),
    ]
    assert [re.search(r"message \d: expected 999 rows", bad) is not None for bad in source.bad] == [
        True,
        True,
    ]


def test_a_bag_of_an_older_ros2_does_not_say_what_its_messages_look_like(tmp_path: Path) -> None:
    with Bag(tmp_path, "sqlite3") as bag:
        bag.image("/image", IMAGES[0], TIMES[0])
    (file,) = bag.path.glob("*.db3")
    with closing(sqlite3.connect(file)) as database, database:
        database.execute("DELETE FROM message_definitions")
    (frame,) = frames_open(bag.path)
    assert np.array_equal(frame.image, IMAGES[0])
