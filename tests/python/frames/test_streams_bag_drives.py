"""Bags as drives leave them: in parts, of many topics, with clocks that stop and jump."""

import io
import shutil
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from mcap_protobuf.writer import Writer
from PIL import Image

import surefix
from recordings import KINDS, Bag, packets, pictures
from surefix.frames import BagFrames, Frames, Odometry, image_of
from surefix.frames import open as frames_open

IMAGES = pictures(30)
START = 1_700_000_000.0


def write(
    folder: Path, kind: str, numbers: range, name: str | None = None, start: float = START
) -> Path:
    """A bag of some of the images, ten a second."""
    if name is None:
        name = f"drive_{numbers[0]}" + (".bag" if kind == "ros1" else "")
    with Bag(folder, kind, name) as bag:
        for number in numbers:
            bag.image("/image", IMAGES[number], start + number / 8)
    return bag.path


def shown(source: Frames) -> list[int]:
    """The number of each frame's picture."""
    return [
        next(at for at, each in enumerate(IMAGES) if np.array_equal(each, frame.image))
        for frame in source
    ]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("way", ["folder", "pattern", "list"])
def test_the_parts_of_a_split_bag_are_one_drive(tmp_path: Path, kind: str, way: str) -> None:
    # In time's order, which the names' is not.
    parts = [write(tmp_path, kind, numbers) for numbers in (range(8), range(8, 11), range(11, 30))]
    place = {"folder": tmp_path, "pattern": tmp_path / "drive_*", "list": parts}[way]
    source = frames_open(place)
    assert isinstance(source, BagFrames)
    assert len(source) == 30
    assert shown(source) == [*range(30)]
    frames = list(source)
    assert [frame.time for frame in frames] == [START + number / 8 for number in range(30)]
    assert not any(frame.breaks for frame in frames)
    assert source.remarks == []


def test_bags_of_ros_1_and_2_may_be_mixed(tmp_path: Path) -> None:
    write(tmp_path, "ros1", range(8))
    write(tmp_path, "mcap", range(8, 30))
    assert shown(frames_open(tmp_path)) == [*range(30)]


@pytest.mark.parametrize("kind", ["sqlite3", "mcap"])
def test_the_files_of_one_ros2_folder_are_one_drive(tmp_path: Path, kind: str) -> None:
    path = write(tmp_path, kind, range(10), "drive")
    ending = {"sqlite3": "db3", "mcap": "mcap"}[kind]
    (first,) = path.glob(f"*.{ending}")
    other = write(tmp_path, kind, range(10, 20), "other")
    shutil.copy(next(other.glob(f"*.{ending}")), path / f"drive_1.{ending}")
    text = (path / "metadata.yaml").read_text()
    (path / "metadata.yaml").write_text(
        text.replace(f"- {first.name}\n", f"- {first.name}\n  - drive_1.{ending}\n", 1)
    )
    assert shown(frames_open(path)) == [*range(20)]
    # A file that is lost: those that are there.
    first.unlink()
    source = BagFrames(path, skip_bad=True)
    assert shown(source) == [*range(10, 20)]
    assert first.name in source.remarks[0]


def test_gaps_and_overlaps_of_parts_are_said(tmp_path: Path) -> None:
    write(tmp_path, "ros1", range(12), "a.bag")
    write(tmp_path, "ros1", range(8, 16), "b.bag")
    write(tmp_path, "ros1", range(26, 30), "c.bag")
    source = frames_open(tmp_path)
    frames = list(source)
    assert shown(source) == [*range(16), *range(26, 30)]
    assert [index for index, frame in enumerate(frames) if frame.gap] == [16]
    copies, gap, overlap = source.remarks
    assert copies.startswith("4 messages left out: a copy")
    assert gap == f"a gap of 1.4 s between {tmp_path}/b.bag and {tmp_path}/c.bag"
    assert overlap.startswith(f"{tmp_path}/a.bag and {tmp_path}/b.bag overlap by 0.4 s")


def test_a_damaged_part_is_passed_over_and_said(tmp_path: Path) -> None:
    parts = [write(tmp_path, "ros1", numbers) for numbers in (range(10), range(10, 20))]
    parts.append(write(tmp_path, "ros1", range(20, 30)))
    parts[1].write_bytes(parts[1].read_bytes()[:-3000])
    source = BagFrames(tmp_path, skip_bad=True)
    assert shown(source) == [*range(10), *range(20, 30)]
    assert source.remarks[0].startswith(f"passed over: {parts[1]}: expected a bag")
    assert "rosbag reindex" in source.remarks[0]
    with pytest.raises(surefix.SurefixValueError, match=r"drive_10\.bag: expected a bag"):
        frames_open(tmp_path)


def test_images_beside_bags_are_the_drive(tmp_path: Path) -> None:
    write(tmp_path, "ros1", range(3))
    Image.fromarray(IMAGES[0]).save(tmp_path / "0.png")
    assert not isinstance(frames_open(tmp_path), BagFrames)


@pytest.mark.parametrize("zero", [[True] * 10, [False] * 2 + [True] * 3 + [False] * 5])
def test_one_clock_if_stamps_are_missing(tmp_path: Path, zero: list[bool]) -> None:
    with Bag(tmp_path, "mcap") as bag:
        for index, none in enumerate(zero):
            recorded = 1000 + index / 8
            stamp = 0.0 if none else 500 + index / 8
            bag.image("/image", IMAGES[index], stamp, recorded=recorded)
            bag.pose("/odom", "nav_msgs/msg/Odometry", (index, 0, 0), 500 + index / 8)
    source = frames_open(bag.path, gap=1)
    frames = list(source)
    assert [frame.time for frame in frames] == [1000 + index / 8 for index in range(10)]
    assert not any(frame.gap for frame in frames)
    assert source.source.remarks == [
        f"{sum(zero)} of 10 stamps are 0: times are those of the recording"
    ]


def test_the_odometry_of_a_bag_has_the_clock_of_its_images(tmp_path: Path) -> None:
    with Bag(tmp_path, "mcap") as bag:
        for index in range(10):
            bag.image("/image", IMAGES[index], 0.0, recorded=1000 + index / 8)
            message = bag.make("geometry_msgs/msg/Point", 2.0 * index, 0.0, 0.0)
            turned = bag.make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
            pose = bag.make("geometry_msgs/msg/Pose", message, turned)
            stamped = bag.make("geometry_msgs/msg/PoseStamped", bag.header(7.0 + index / 8), pose)
            bag.write("/pose", stamped, 1000 + index / 8)
    taken = frames_open(bag.path, metres=4, odometry="/pose")
    assert [int(frame.name) for frame in taken] == [0, 2, 4, 6, 8]
    assert Odometry.from_bag(bag.path).times[0] == 7.0


def test_the_clock_of_a_simulator_begins_at_0(tmp_path: Path) -> None:
    with Bag(tmp_path, "mcap") as bag:
        for index in range(10):
            bag.image("/image", IMAGES[index], index / 8, recorded=1000 + index / 4)
    source = frames_open(bag.path)
    assert [frame.time for frame in source] == [index / 8 for index in range(10)]
    assert source.remarks == []


def test_stamps_that_stand_still_are_none(tmp_path: Path) -> None:
    with Bag(tmp_path, "mcap") as bag:
        for index in range(10):
            bag.image("/image", IMAGES[index], 5.0, recorded=1000 + index / 8)
    source = frames_open(bag.path)
    assert [frame.time for frame in source] == [1000 + index / 8 for index in range(10)]
    assert "9 of 10 stamps repeat the one before" in source.remarks[0]


def test_stamps_in_another_unit_are_none(tmp_path: Path) -> None:
    recorded = [1_700_000_000 + index / 8 for index in range(80)]
    with Bag(tmp_path, "mcap") as bag:
        for index, time in enumerate(recorded):
            # Microseconds, written as nanoseconds.
            bag.image("/image", IMAGES[index % len(IMAGES)], time / 1000, recorded=time)
    taken = frames_open(bag.path, every=1.0)
    assert [frame.time for frame in taken] == pytest.approx(recorded[::8], abs=1e-6, rel=0)
    source = frames_open(bag.path)
    assert [frame.time for frame in source] == pytest.approx(recorded, abs=1e-6, rel=0)
    said = "80 stamps span 0.00988 s, the recording 9.88 s: times are those of the recording"
    assert said in source.remarks
    # A simulator at a tenth of its speed is none of them.
    with Bag(tmp_path / "slow", "mcap") as bag:
        for index, time in enumerate(recorded):
            bag.image("/image", IMAGES[index % len(IMAGES)], index / 80, recorded=time)
    source = frames_open(bag.path)
    assert [frame.time for frame in source] == [index / 80 for index in range(80)]
    assert not any("stamps" in each for each in source.remarks)


def test_a_bag_recorded_in_a_loop_has_a_stretch_a_lap(tmp_path: Path) -> None:
    with Bag(tmp_path, "ros1") as bag:
        for index in range(30):
            bag.image("/image", IMAGES[index], 100 + index % 10 / 8, recorded=1000 + index / 8)
    source = frames_open(bag.path)
    frames = list(source)
    assert shown(source) == [*range(30)]
    assert [index for index, frame in enumerate(frames) if frame.gap] == [10, 20]
    for lap in range(3):
        times = [frame.time for frame in frames[10 * lap : 10 * lap + 10]]
        assert times == [100 + index / 8 for index in range(10)]
    assert source.remarks == [
        f"the clock goes back by 1.125 s at message {at}: a gap" for at in (10, 20)
    ]


def test_messages_that_come_late_are_put_in_order(tmp_path: Path) -> None:
    order = [0, 1, 3, 2, 4, 7, 5, 6, 8, 9]
    with Bag(tmp_path, "mcap") as bag:
        for at, index in enumerate(order):
            bag.image("/image", IMAGES[index], 100 + index / 8, recorded=1000 + at / 8)
        # Sent twice by its driver.
        bag.image("/image", IMAGES[9], 100 + 9 / 8, recorded=1002.0)
    source = frames_open(bag.path)
    assert shown(source) == [*range(10)]
    assert source.remarks == [
        "2 messages recorded late, put in order",
        "1 message left out: the time of another message",
    ]


def test_a_stamp_out_of_place_is_left_out(tmp_path: Path) -> None:
    stamps = [100 + index / 8 for index in range(30)]
    stamps[25] = 7.0
    with Bag(tmp_path, "mcap") as bag:
        for index, stamp in enumerate(stamps):
            bag.image("/image", IMAGES[index], stamp, recorded=1000 + index / 8)
    source = frames_open(bag.path)
    assert shown(source) == [*range(25), *range(26, 30)]
    assert "1 message left out: older than 16 recorded before" in source.remarks


def png(image: npt.NDArray[np.generic]) -> bytes:
    content = io.BytesIO()
    Image.fromarray(image).save(content, "png")
    return content.getvalue()


def test_the_only_cameras_topic_is_taken_beside_all_else(tmp_path: Path) -> None:
    mask = np.zeros((48, 64), np.uint8)
    mask[10:20] = 255
    depth = np.arange(48 * 64, dtype=np.uint16).reshape(48, 64)
    with Bag(tmp_path, "mcap") as bag:
        for index in range(5):
            time = START + index / 8
            bag.image("/front/image_raw", IMAGES[index], time)
            bag.compressed("/front/image_raw/compressed", png(IMAGES[index]), "rgb8; png", time)
            bag.compressed("/z/compressedDepth", b"0" * 50, "16UC1; compressedDepth png", time)
            bag.image("/labels", mask, time, encoding="mono8")
            bag.image("/aligned/image", depth, time, encoding="16UC1")
            bag.image("/range", depth.astype(np.float32), time, encoding="32FC1")
            bag.image("/depth/coloured", IMAGES[0], time)
    source = frames_open(bag.path)
    assert isinstance(source, BagFrames)
    assert source.topic == "/front/image_raw"
    assert shown(source) == [*range(5)]
    (remark,) = source.remarks
    assert remark.startswith("images of /front/image_raw; passed over: ")
    others = ("compressed (the same camera)", "compressedDepth (a depth image)", "/labels (a mask")
    assert all(words in remark for words in others)
    # Any of them, if it is asked for.
    assert next(iter(frames_open(bag.path, topic="/labels"))).image.max() == 255


def test_two_cameras_are_listed_with_type_number_and_size(tmp_path: Path) -> None:
    with Bag(tmp_path, "ros1") as bag:
        for index in range(5):
            bag.image("/left", IMAGES[index], START + index)
            bag.image("/depth", np.ones((4, 6), np.uint16), START + index, encoding="16UC1")
            bag.compressed("/right/compressed", png(IMAGES[index][:24]), "png", START + index)
    listed = (
        r"several: /left \(sensor_msgs/msg/Image, 5 messages, 64 x 48, rgb8\), "
        r"/right/compressed \(sensor_msgs/msg/CompressedImage, 5 messages, 64 x 24, png\)$"
    )
    with pytest.raises(surefix.SurefixValueError, match=listed):
        frames_open(bag.path)


def test_a_thermal_camera_alone_is_the_camera(tmp_path: Path) -> None:
    with Bag(tmp_path, "mcap") as bag:
        bag.image("/thermal", np.full((4, 6), 257 * 9, np.uint16), START, encoding="mono16")
    assert next(iter(frames_open(bag.path))).image.tolist() == [[257 * 9] * 6] * 4


PLANAR = {
    "nv12": cv2.COLOR_YUV2GRAY_NV12,
    "nv21": cv2.COLOR_YUV2GRAY_NV21,
    "NV12": cv2.COLOR_YUV2GRAY_NV12,
    "i420": cv2.COLOR_YUV2GRAY_I420,
    "yuv420": cv2.COLOR_YUV2GRAY_I420,
}


def raw(
    data: npt.NDArray[np.uint8], encoding: str, size: tuple[int, int], step: int
) -> SimpleNamespace:
    height, width = size
    return SimpleNamespace(
        height=height, width=width, encoding=encoding, is_bigendian=0, step=step,
        data=data.reshape(-1),
    )  # fmt: skip


@pytest.mark.parametrize("encoding", PLANAR)
@pytest.mark.parametrize("padding", [0, 4])
def test_of_planes_the_brightness_is_opencvs(encoding: str, padding: int) -> None:
    planes = np.random.default_rng(0).integers(0, 256, (12, 6), np.uint8)
    padded = np.pad(planes, ((0, 0), (0, padding)))
    expected = cv2.cvtColor(planes, PLANAR[encoding])
    # Drivers count the rows of the picture, or all.
    for height in (8, 12):
        given = raw(padded, encoding, (height, 6), 6 + padding)
        assert np.array_equal(image_of(given), expected)


def test_other_encodings_of_drivers() -> None:
    generator = np.random.default_rng(0)
    pixels = generator.integers(0, 256, (4, 6, 4), np.uint8)
    assert np.array_equal(image_of(raw(pixels, "8UC4", (4, 6), 24)), pixels[..., [2, 1, 0]])
    full = generator.integers(0, 256, (12, 6), np.uint8)
    assert np.array_equal(image_of(raw(full, "nv24", (4, 6), 6)), full[:4])
    shares = generator.uniform(0, 1, (4, 6)).astype("<f4")
    shares[0, 0] = np.nan
    image = image_of(raw(shares.view(np.uint8), "32FC1", (4, 6), 24))
    assert image.dtype == np.uint16
    assert image[0, 0] == 0
    assert np.abs(image[1:] - 256 * shares[1:]).max() <= 0.51
    # The last row without its padding, and a driver that leaves the step out.
    padded = np.pad(pixels[..., 0], ((0, 0), (0, 5)))
    cut = padded.reshape(-1)[:-5]
    assert np.array_equal(image_of(raw(cut, "mono8", (4, 6), 11)), pixels[..., 0])
    alone = np.ascontiguousarray(pixels[..., 0])
    assert np.array_equal(image_of(raw(alone, "mono8", (4, 6), 0)), alone)
    with pytest.raises(surefix.SurefixValueError, match=r"12 rows of 6 bytes .*nv24"):
        image_of(raw(full[:8], "nv24", (4, 6), 6))


def test_a_recording_that_was_cut_short_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    images = pictures(60, 240, 320)
    with Bag(tmp_path, "mcap") as bag:
        for index, image in enumerate(images):
            bag.image("/image", image, START + index / 8)
    (file,) = bag.path.glob("*.mcap")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(file.read_bytes()[: file.stat().st_size * 2 // 3])
    source = BagFrames(cut, skip_bad=True)
    frames = list(source)
    assert 30 <= len(frames) <= 40
    assert all(np.array_equal(frame.image, images[int(frame.name)]) for frame in frames)
    assert [int(frame.name) for frame in frames] == [*range(len(frames))]
    assert source.remarks[0].startswith(f"{cut}: damaged: read as far as it goes (")
    with pytest.raises(surefix.SurefixValueError, match=r"cut\.mcap: expected .*: mcap recover$"):
        frames_open(cut)
    # As does a folder whose recorder was cut off.
    (bag.path / "metadata.yaml").unlink()
    file.write_bytes(cut.read_bytes())
    assert len(list(BagFrames(bag.path, skip_bad=True))) == len(frames)


def test_messages_of_protobuf(tmp_path: Path) -> None:
    video = packets(IMAGES)
    with (tmp_path / "foxglove.mcap").open("wb") as file, Writer(file) as writer:
        for number, data in video:
            message = CompressedVideo(data=data, format="h264", frame_id="camera")
            message.timestamp.FromNanoseconds(int(START) * 10**9 + number * 125_000_000)
            writer.write_message("/video", message, int(1e9 * (1 + number)))
        for number in range(5):
            still = CompressedImage(data=png(IMAGES[number]), format="png")
            still.timestamp.FromNanoseconds(int(START) * 10**9 + number * 125_000_000)
            writer.write_message("/still", still, int(1e9 * (1 + number)))
    source = frames_open(tmp_path / "foxglove.mcap", topic="/video")
    frames = list(source)
    assert [frame.time for frame in frames] == [START + number / 8 for number in range(30)]
    assert np.abs(frames[9].image.astype(int) - IMAGES[9]).mean() < 12
    assert shown(frames_open(tmp_path / "foxglove.mcap", topic="/still")) == [*range(5)]
