"""``surefix demo --save-drives``: two drives along a generated road, as files to try things on."""

import io
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from surefix._core import _AtomicFolder
from surefix._extra import require
from surefix._saving import save
from surefix.errors import SurefixFileError, mismatch, refusal
from surefix.simulate import Route

__all__ = ["Form", "save_drives"]

Form = Literal["images", "video", "bag"]
UInt8 = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float64]

RATE = 10
# The second drive waits at a red light; later its camera says nothing for a while, in seconds.
STOP, HANG = 4, 3
# When the drives of a bag begin: two days of November 2023.
BEGINS = {"summer": 1_700_000_000, "winter": 1_700_100_000}
IMAGES, WHEELS = "/camera/image_raw", "/odom"
ODOMETRY = "odometry.csv"
PROBLEM = "cannot write the drives"


def save_drives(folder: Path, form: Form, road: Route) -> list[Path]:
    """Writes the road's drive in summer and that in winter; returns their paths.

    As images both have a picture of each place. Recordings have ten frames a second; in winter the
    robot stands for four seconds in the middle, and its camera hangs for three later on. Beside a
    video lies the winter's ``odometry.csv``; bags have a topic of ``Odometry``.

    Each drive is there whole or not at all.

    Raises
    ------
    SurefixError
        If a drive is there already, or cannot be written, or its library is not installed.
    """
    names = [f"{name}.mp4" if form == "video" else name for name in BEGINS]
    paths = [folder / name for name in names]
    for path in [*paths, *([folder / ODOMETRY] if form == "video" else [])]:
        _check_free(path)
    write: dict[Form, Callable[..., None]] = {"images": _images, "video": _video, "bag": _bag}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, path in zip(BEGINS, paths, strict=True):
            drive = road.reference() if name == "summer" else road.revisit()
            frames, times = np.arange(len(drive)), np.arange(len(drive)) / RATE
            if name == "winter" and form != "images":
                frames, times = _stopped(len(drive))
            images = [drive[frame] for frame in frames]
            write[form](path, images, times, np.asarray(drive.positions)[frames])
    except SurefixFileError:
        raise
    except OSError as error:
        raise refusal(folder, PROBLEM, error) from None
    return paths


def _check_free(path: Path) -> None:
    if path.exists():
        raise mismatch("--save-drives", f"a folder without {path.name}", f"{path}")


@contextmanager
def _filled(path: Path) -> Iterator[Path]:
    """The new folder, filled beside its name."""
    new = _AtomicFolder(path)
    try:
        # No other writer can begin it from here on.
        _check_free(path)
        yield new.path
        new.commit([], "")
    finally:
        new.discard()


def _stopped(count: int) -> tuple[npt.NDArray[np.int64], Floats]:
    """Frame by frame which image is seen, and when, in seconds."""
    stop, hang = count * 8 // 15, count * 4 // 5
    frames = np.concatenate([np.arange(stop), np.full(STOP * RATE, stop), np.arange(stop, count)])
    late = np.arange(len(frames)) >= hang + STOP * RATE
    return frames, np.arange(len(frames)) / RATE + HANG * late


def _images(path: Path, images: Sequence[UInt8], times: Floats, along: Floats) -> None:
    pillow = require("PIL.Image", "a folder of images", "Pillow", "surefix[report]")
    with _filled(path) as new:
        for index, image in enumerate(images):
            pillow.fromarray(image).save(new / f"{index:04}.png")


def _video(path: Path, images: Sequence[UInt8], times: Floats, along: Floats) -> None:
    av = require("av", "a video", "PyAV", "surefix[video]")
    height, width = images[0].shape[:2]
    film = io.BytesIO()
    with av.open(film, "w", format="mp4") as container:
        track = container.add_stream("mpeg4", rate=RATE)
        track.width, track.height, track.pix_fmt = width, height, "yuv420p"
        track.bit_rate = 200 * width * height
        for image, time in zip(images, times, strict=True):
            frame = av.VideoFrame.from_ndarray(image, format="rgb24")
            frame.pts, frame.time_base = round(time * RATE), Fraction(1, RATE)
            container.mux(track.encode(frame))
        container.mux(track.encode())
    save(path, film.getvalue(), PROBLEM)
    if path.stem == "winter":
        rows = [f"{time:.1f},{far:.2f}\n" for time, far in zip(times, along, strict=True)]
        save(path.parent / ODOMETRY, "time,distance\n" + "".join(rows), PROBLEM)


def _bag(path: Path, images: Sequence[UInt8], times: Floats, along: Floats) -> None:
    with _filled(path) as new:
        # The writer makes its folder, and names the recording after it.
        own = new / path.name
        _write_bag(own, images, times, along)
        for file in own.iterdir():
            file.rename(new / file.name)
        own.rmdir()


def _write_bag(path: Path, images: Sequence[UInt8], times: Floats, along: Floats) -> None:
    require("rosbags", "a bag", "rosbags", "surefix[bags]")
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)

    def made(kind: str, *fields: Any) -> Any:
        return store.types[kind](*fields)

    def header(nanoseconds: int) -> Any:
        stamp = made("builtin_interfaces/msg/Time", *divmod(nanoseconds, 10**9))
        return made("std_msgs/msg/Header", stamp, "camera")

    def odometry(nanoseconds: int, far: float) -> Any:
        point = made("geometry_msgs/msg/Point", far, 0.0, 0.0)
        ahead = made("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
        pose = made("geometry_msgs/msg/Pose", point, ahead)
        zero = made("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        twist = made("geometry_msgs/msg/Twist", zero, zero)
        unknown = np.zeros(36)
        return made(
            "nav_msgs/msg/Odometry",
            header(nanoseconds),
            "base",
            made("geometry_msgs/msg/PoseWithCovariance", pose, unknown),
            made("geometry_msgs/msg/TwistWithCovariance", twist, unknown),
        )

    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        topics = {IMAGES: "sensor_msgs/msg/Image", WHEELS: "nav_msgs/msg/Odometry"}
        to = {
            topic: bag.add_connection(topic, kind, typestore=store)
            for topic, kind in topics.items()
        }

        def write(topic: str, nanoseconds: int, message: Any) -> None:
            bag.write(to[topic], nanoseconds, store.serialize_cdr(message, topics[topic]))

        for image, time, far in zip(images, times, along, strict=True):
            height, width = image.shape[:2]
            at = BEGINS[path.name] * 10**9 + round(time * 1e9)
            flat = np.ascontiguousarray(image).reshape(-1)
            shape = height, width, "rgb8", 0, 3 * width
            write(IMAGES, at, made(topics[IMAGES], header(at), *shape, flat))
            write(WHEELS, at, odometry(at, float(far)))
