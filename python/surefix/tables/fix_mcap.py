"""Fixes as an MCAP file, to be played beside a bag: poses of ROS 2, and each row as JSON."""

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np

from surefix._extra import require
from surefix.errors import mismatch
from surefix.motion import PERHAPS_OFF
from surefix.tables.route_poses import RoutePoses, quaternion

# Topics as the ROS 2 package has them, so that its layout of Foxglove fits.
POSE, NAVSAT = "geometry_msgs/msg/PoseWithCovarianceStamped", "sensor_msgs/msg/NavSatFix"
ROUTE = "geometry_msgs/msg/PoseArray"
TOPICS = {POSE: "/surefix/pose", NAVSAT: "/surefix/navsat", ROUTE: "/surefix/route"}
ROWS = "/surefix/fix"
FRAME = "map"
NANOSECONDS = 1_000_000_000
# Their seconds have 32 bits.
LATEST = 1 << 31
# NavSatStatus and NavSatFix.
NO_FIX, FIX, UNKNOWN, APPROXIMATED = -1, 0, 0, 1
# The most places of the route that are drawn.
PLACES = 20_000
# A fix of this belief to be off the map has no pose.
OFF = 0.5


class _Messages:
    """ROS 2's messages, made by rosbags."""

    def __init__(self) -> None:
        types = require("rosbags.typesys", "an MCAP file of poses", "rosbags", "surefix[bags]")
        self.store: Any = types.get_typestore(types.Stores.ROS2_HUMBLE)

    def make(self, kind: str, *fields: Any) -> Any:
        return self.store.types[kind](*fields)

    def header(self, stamp: int) -> Any:
        time = self.make("builtin_interfaces/msg/Time", *divmod(stamp, NANOSECONDS))
        return self.make("std_msgs/msg/Header", time, FRAME)

    def definition(self, kind: str) -> bytes:
        return str(self.store.generate_msgdef(kind, ros_version=2)[0]).encode()

    def bytes_of(self, message: Any) -> bytes:
        return bytes(self.store.serialize_cdr(message, message.__msgtype__))

    def pose(self, at: Sequence[float], yaw: float) -> Any:
        point = self.make("geometry_msgs/msg/Point", *map(float, at))
        turn = self.make("geometry_msgs/msg/Quaternion", *quaternion(yaw))
        return self.make("geometry_msgs/msg/Pose", point, turn)

    def route(self, poses: RoutePoses, stamp: int) -> Any:
        """A PoseArray of the map's places."""
        step = -(-len(poses.yaws) // PLACES)
        places = zip(poses.positions[::step].tolist(), poses.yaws[::step].tolist(), strict=True)
        return self.make(ROUTE, self.header(stamp), [self.pose(*each) for each in places])


@contextmanager
def mcap_writer(file: Any, poses: RoutePoses) -> Iterator[Any]:
    """Writes each fix at its time: a PoseWithCovarianceStamped, if it is probably on the map; a
    NavSatFix, if degrees are known; and the row. The route comes first. A track without its belief
    has the covariance 0: not known.
    """
    module = require("mcap.writer", "an MCAP file of poses", "mcap", "surefix[bags]")
    messages = _Messages()
    mcap: Any = module.Writer(file)
    mcap.start(library="surefix")
    channels: dict[str, int] = {}

    def channel(topic: str, coding: str, name: str, kind: str, text: Callable[[], bytes]) -> int:
        if topic not in channels:
            schema = mcap.register_schema(name, kind, text())
            channels[topic] = mcap.register_channel(topic, coding, schema)
        return channels[topic]

    def send(message: Any, at: int) -> None:
        kind = message.__msgtype__
        text = partial(messages.definition, kind)
        number = channel(TOPICS[kind], "cdr", kind, "ros2msg", text)
        mcap.add_message(number, at, messages.bytes_of(message), at)

    def write(row: dict[str, Any], belief: Callable[[], Any] | None = None) -> None:
        if row["time"] is None:
            return
        at = stamp_of(row["time"])
        if not channels:
            send(messages.route(poses, at), at)
        known, off = None if belief is None else belief(), row.get("off_map")
        sure = row.get("accepted", row.get("trusted", False))
        lost = off > PERHAPS_OFF if off is not None else not sure
        pose = poses.pose(row["place"], known, lost)
        if known is None and off is not None:
            pose = pose._replace(covariance=np.zeros(36))
        on_map = off is None or off < OFF
        if on_map:
            placed = messages.pose(pose.position, pose.yaw)
            whole = messages.make("geometry_msgs/msg/PoseWithCovariance", placed, pose.covariance)
            send(messages.make(POSE, messages.header(at), whole), at)
        if "latitude" in row:
            kind = APPROXIMATED if pose.covariance.any() else UNKNOWN
            status = messages.make("sensor_msgs/msg/NavSatStatus", FIX if on_map else NO_FIX, 0)
            # A height in the map is not known to be above the ellipsoid.
            where = row["latitude"], row["longitude"], float("nan")
            spread = pose.covariance.reshape(6, 6)[:3, :3].ravel()
            head = messages.header(at)
            send(messages.make(NAVSAT, head, status, *where, spread, kind), at)
        number = channel(ROWS, "json", "surefix.Fix", "jsonschema", partial(_schema, row))
        mcap.add_message(number, at, json.dumps(row).encode(), at)

    try:
        yield write
    finally:
        # After an error too, what was written can be read.
        mcap.finish()


def stamp_of(seconds: float) -> int:
    """Nanoseconds since 1970, as far as ROS 2's messages count them."""
    if not 0 <= seconds < LATEST:
        raise mismatch("times", f"seconds from 0 to {LATEST - 1} for MCAP", f"{seconds:g}")
    return round(seconds * NANOSECONDS)


def _schema(row: dict[str, Any]) -> bytes:
    """Of a row, in JSON Schema."""
    kinds = {bool: "boolean", int: "integer", float: "number", str: "string"}
    named = {name: {"type": kinds.get(type(value), "number")} for name, value in row.items()}
    return json.dumps({"title": "surefix.Fix", "type": "object", "properties": named}).encode()
