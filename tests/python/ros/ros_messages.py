"""Messages of ROS 2 as rosbags defines them, surefix_msgs among them, and two drives of a road."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import surefix
from surefix.simulate import Route

ROS2 = Path(__file__).resolve().parents[3] / "ros2"
PACKAGE = ROS2 / "surefix_ros"
sys.path.insert(0, str(PACKAGE))

# Both have all that surefix_ros needs, and a Python that surefix runs on.
DISTRIBUTIONS = (Stores.ROS2_JAZZY, Stores.ROS2_KILTED)
PLACES = 60
PERIOD = 0.125

# The map's file, the map, the images of a second drive, and where each was taken.
Drive = tuple[Path, surefix.Map, list[np.ndarray], np.ndarray]


class Messages:
    """The messages of a distribution; ``make`` is as ``surefix_ros.messages`` takes it."""

    def __init__(self, distribution: Stores = Stores.ROS2_JAZZY) -> None:
        self.store = get_typestore(distribution)
        text = (ROS2 / "surefix_msgs" / "msg" / "Fix.msg").read_text(encoding="utf-8")
        self.store.register(get_types_from_msg(text, "surefix_msgs/msg/Fix"))

    def make(self, kind: str, **fields: Any) -> Any:
        return self.store.types[kind](**fields)

    def wired(self, message: Any) -> Any:
        """The message as it comes out of the wire."""
        kind = message.__msgtype__
        return self.store.deserialize_cdr(self.store.serialize_cdr(message, kind), kind)

    def stamp(self, time: float) -> Any:
        nanoseconds = round(time * 1e9)
        second, rest = divmod(nanoseconds, 10**9)
        return self.make("builtin_interfaces/msg/Time", sec=second, nanosec=rest)

    def header(self, time: float, frame: str = "camera") -> Any:
        return self.make("std_msgs/msg/Header", stamp=self.stamp(time), frame_id=frame)

    def image(self, image: np.ndarray, time: float, encoding: str = "rgb8") -> Any:
        height, width = image.shape[:2]
        return self.wired(
            self.make(
                "sensor_msgs/msg/Image", header=self.header(time), height=height, width=width,
                encoding=encoding, is_bigendian=0, step=image[0].nbytes,
                data=np.frombuffer(image.tobytes(), np.uint8),
            )
        )  # fmt: skip

    def compressed(self, data: bytes, form: str, time: float) -> Any:
        kind = "sensor_msgs/msg/CompressedImage"
        flat = np.frombuffer(data, np.uint8)
        return self.wired(self.make(kind, header=self.header(time), format=form, data=flat))

    def odometry(
        self, position: np.ndarray, yaw: float, time: float, speed: float = 0.0, turned: bool = True
    ) -> Any:
        """A nav_msgs Odometry; ``turned`` is False for an orientation that was never set."""
        make, none = self.make, np.zeros(36)
        x, y, z = (*map(float, position), 0.0)[:3]
        z_, w = (np.sin(yaw / 2), np.cos(yaw / 2)) if turned else (0.0, 0.0)
        turn = make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=float(z_), w=float(w))
        point = make("geometry_msgs/msg/Point", x=x, y=y, z=z)
        pose = make("geometry_msgs/msg/Pose", position=point, orientation=turn)
        zero = make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
        ahead = make("geometry_msgs/msg/Vector3", x=float(speed), y=0.0, z=0.0)
        twist = make("geometry_msgs/msg/Twist", linear=ahead, angular=zero)
        return self.wired(
            make(
                "nav_msgs/msg/Odometry", header=self.header(time, "odom"), child_frame_id="base_link",
                pose=make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=none),
                twist=make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=none),
            )
        )  # fmt: skip


def road(folder: Path, **more: Any) -> Drive:
    """A quarter of a circle of 100 m."""
    route = Route(places=PLACES, size=(96, 48))
    angle = np.linspace(0, np.pi / 2, PLACES)
    positions = 100 * np.stack([np.sin(angle), 1 - np.cos(angle)], axis=1)
    revisit = route.revisit()
    made = surefix.Map.from_images(route.reference(), positions=positions, **more)
    file = folder / "route.safetensors"
    made.save(file)
    return file, made, [revisit[i] for i in range(PLACES)], positions
