"""Videos and bags, made by the libraries that others make them with."""

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import numpy.typing as npt
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

UInt8 = npt.NDArray[np.uint8]
# Of each kind of bag, how its file or folder ends.
KINDS = {"ros1": "drive.bag", "sqlite3": "drive_sqlite3", "mcap": "drive_mcap"}


def pictures(count: int, height: int = 48, width: int = 64, seed: int = 0) -> list[UInt8]:
    """Colour images that differ: (height, width, 3)."""
    generator = np.random.default_rng(seed)
    blocks = generator.integers(0, 256, (count, height // 8, width // 8, 3), np.uint8)
    return list(blocks.repeat(8, axis=1).repeat(8, axis=2))


def write_video(
    path: Path,
    images: Sequence[UInt8],
    *,
    rate: int = 10,
    stamps: Sequence[int] | None = None,
    codec: str = "ffv1",
    pixels: str = "bgr0",
    rotation: int = 0,
    sound: float = 0,
) -> Path:
    """A video: without loss by default; ``stamps`` in units of ``1 / rate`` seconds; silence for
    ``sound`` seconds.
    """
    with av.open(str(path), "w") as container:
        track = container.add_stream(codec, rate=rate)
        track.height, track.width = images[0].shape[:2]
        track.pix_fmt = pixels
        if rotation:
            track.set_display_rotation(rotation)
        silence = container.add_stream("aac", rate=48000, layout="mono") if sound else None
        for index, image in enumerate(images):
            frame = av.VideoFrame.from_ndarray(image, format="rgb24")
            frame.pts, frame.time_base = (
                (index if stamps is None else stamps[index]),
                Fraction(1, rate),
            )
            container.mux(track.encode(frame))
        container.mux(track.encode())
        if silence is not None:
            samples = np.zeros((1, int(48000 * sound)), np.float32)
            frame = av.AudioFrame.from_ndarray(samples, format="fltp", layout="mono")
            frame.sample_rate, frame.pts = 48000, 0
            container.mux(silence.encode(frame))
            container.mux(silence.encode())
    return path


# Messages that are no part of ROS itself.
DEFINITIONS = {
    "foxglove_msgs/msg/CompressedVideo": "builtin_interfaces/Time timestamp\nstring frame_id\nuint8[] data\nstring format\n",
    "ffmpeg_image_transport_msgs/msg/FFMPEGPacket": "std_msgs/Header header\nint32 width\nint32 height\nstring encoding\nuint64 pts\nuint8 flags\nbool is_bigendian\nuint8[] data\n",
}


def packets(
    images: Sequence[UInt8], codec: str = "libx264", **options: str
) -> list[tuple[int, bytes]]:
    """A video's packets: the number of the picture that each holds, and its bytes (Annex B)."""
    context: Any = av.CodecContext.create(codec, "w")
    context.height, context.width = images[0].shape[:2]
    context.pix_fmt, context.time_base = "yuv420p", Fraction(1, 10)
    context.options = {"g": "10", "bf": "0", "crf": "5", "preset": "ultrafast", **options}
    found = []
    for index, image in enumerate(images):
        frame = av.VideoFrame.from_ndarray(image, format="rgb24")
        frame.pts = index
        found += context.encode(frame)
    found += context.encode(None)
    return [(packet.pts, bytes(packet)) for packet in found]


class Bag:
    """A bag being written: ``with Bag(folder, "mcap") as bag: bag.image("/camera", array,
    12.5)``.
    """

    def __init__(self, folder: Path, kind: str, name: str | None = None) -> None:
        self.path = folder / (name or KINDS[kind])
        self.ros1 = kind == "ros1"
        self.store = get_typestore(Stores.ROS1_NOETIC if self.ros1 else Stores.ROS2_HUMBLE)
        if not self.ros1:
            for defined, text in DEFINITIONS.items():
                self.store.register(get_types_from_msg(text, defined))
        storage = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        self.writer: Any = (
            Writer1(self.path)
            if self.ros1
            else Writer2(self.path, version=9, storage_plugin=storage)
        )
        self.connections: dict[str, Any] = {}

    def __enter__(self) -> "Bag":
        self.writer.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.writer.close()

    def make(self, kind: str, *fields: Any) -> Any:
        """A message, or a part of one."""
        return self.store.types[kind](*fields)

    def header(self, time: float) -> Any:
        """With this stamp."""
        second = int(time)
        stamp = self.make("builtin_interfaces/msg/Time", second, round((time - second) * 1e9))
        return self.make("std_msgs/msg/Header", *((0,) if self.ros1 else ()), stamp, "camera")

    def write(self, topic: str, message: Any, recorded: float) -> None:
        """A message, as it was recorded at this time."""
        kind = message.__msgtype__
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, kind, typestore=self.store)
        serialize = self.store.serialize_ros1 if self.ros1 else self.store.serialize_cdr
        self.writer.write(self.connections[topic], round(recorded * 1e9), serialize(message, kind))

    def image(
        self, topic: str, data: UInt8, time: float, *, encoding: str = "rgb8", size: tuple[int, int] | None = None,
        step: int | None = None, big: bool = False, recorded: float | None = None,
    ) -> None:  # fmt: skip
        """A sensor_msgs Image of these bytes; ``size`` is (height, width)."""
        height, width = size or data.shape[:2]
        step = step or data.nbytes // height
        header = self.header(time)
        flat = np.frombuffer(data.tobytes(), np.uint8)
        message = self.make(
            "sensor_msgs/msg/Image", header, height, width, encoding, int(big), step, flat
        )
        self.write(topic, message, time if recorded is None else recorded)

    def compressed(self, topic: str, data: bytes, form: str, time: float) -> None:
        """A sensor_msgs CompressedImage."""
        flat = np.frombuffer(data, np.uint8)
        self.write(
            topic, self.make("sensor_msgs/msg/CompressedImage", self.header(time), form, flat), time
        )

    def video(
        self, topic: str, data: bytes, form: str, time: float, kind: str, recorded: float
    ) -> None:
        """A packet of a video: a CompressedVideo, an FFMPEGPacket or a CompressedImage."""
        flat, header = np.frombuffer(data, np.uint8), self.header(time)
        if kind == "CompressedImage":
            message = self.make(f"sensor_msgs/msg/{kind}", header, form, flat)
        elif kind == "CompressedVideo":
            fields = header.stamp, "camera", flat, form
            message = self.make(f"foxglove_msgs/msg/{kind}", *fields)
        else:
            fields = header, 64, 48, form, 0, 0, False, flat
            message = self.make(f"ffmpeg_image_transport_msgs/msg/{kind}", *fields)
        self.write(topic, message, recorded)

    def pose(
        self, topic: str, kind: str, position: Sequence[float], time: float,
        orientation: Sequence[float] = (0, 0, 0, 1), ahead: float = 0.0,
    ) -> None:  # fmt: skip
        """A message of one of the kinds of pose; ``ahead`` is the speed of an Odometry."""
        none, header = np.zeros(36), self.header(time)
        turned = self.make("geometry_msgs/msg/Quaternion", *map(float, orientation))
        point = self.make("geometry_msgs/msg/Point", *map(float, position[:3]))
        pose = self.make("geometry_msgs/msg/Pose", point, turned)
        zero = self.make("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        if kind == "sensor_msgs/msg/NavSatFix":
            status = self.make("sensor_msgs/msg/NavSatStatus", int(position[3]), 1)
            self.write(topic, self.make(kind, header, status, *position[:3], np.zeros(9), 0), time)
            return
        if kind == "geometry_msgs/msg/PoseStamped":
            self.write(topic, self.make(kind, header, pose), time)
            return
        if kind == "geometry_msgs/msg/TransformStamped":
            moved = self.make("geometry_msgs/msg/Vector3", *map(float, position))
            transform = self.make("geometry_msgs/msg/Transform", moved, turned)
            self.write(topic, self.make(kind, header, "base", transform), time)
            return
        with_covariance = self.make("geometry_msgs/msg/PoseWithCovariance", pose, none)
        if kind == "geometry_msgs/msg/PoseWithCovarianceStamped":
            self.write(topic, self.make(kind, header, with_covariance), time)
            return
        speed = self.make("geometry_msgs/msg/Vector3", float(ahead), 0.0, 0.0)
        twist = self.make("geometry_msgs/msg/Twist", speed, zero)
        moving = self.make("geometry_msgs/msg/TwistWithCovariance", twist, none)
        self.write(
            topic, self.make("nav_msgs/msg/Odometry", header, "base", with_covariance, moving), time
        )
