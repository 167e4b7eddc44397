"""Fixes as an MCAP file, to be played beside a bag: poses of ROS 2, and each row as JSON."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np

from surefix._extra import require
from surefix.tables.route_poses import RoutePoses

POSE, LOCATION = "geometry_msgs/msg/PoseWithCovarianceStamped", "sensor_msgs/msg/NavSatFix"
# Topics of the poses in metres, of those in degrees, and of the rows.
TOPICS = {POSE: "/surefix/pose", LOCATION: "/surefix/location"}
ROWS = "/surefix/fix"
FRAME = "map"
NANOSECONDS = 1_000_000_000
# NavSatFix: a fix without augmentation, or none; GPS; how its covariance is known.
NO_FIX, HAS_FIX, GPS, UNKNOWN, KNOWN = -1, 0, 1, 0, 3


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


@contextmanager
def mcap_writer(file: Any, poses: RoutePoses) -> Iterator[Any]:
    """Writes each fix at its time: a PoseWithCovarianceStamped, if it is probably on the map; a
    NavSatFix, if degrees are known; and the row. Without a belief, the covariance is 0: not known.
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
        at = round(row["time"] * NANOSECONDS)
        lost = row.get("off_map", 0.0) >= 0.5
        place, known = row["place"], None if belief is None else belief()
        about = np.zeros((6, 6)) if known is None else poses.covariance(place, known)
        if not lost:
            send(_pose(messages, at, poses, place, about), at)
        if "latitude" in row:
            send(_location(messages, at, row, poses, about, known is not None, lost), at)
        number = channel(ROWS, "json", "surefix.Fix", "jsonschema", partial(_schema, row))
        mcap.add_message(number, at, json.dumps(row).encode(), at)

    try:
        yield write
    finally:
        # After an error too, what was written can be read.
        mcap.finish()


def _pose(messages: _Messages, at: int, poses: RoutePoses, place: int, about: Any) -> Any:
    point = messages.make("geometry_msgs/msg/Point", *poses.positions[place].tolist())
    turn = messages.make("geometry_msgs/msg/Quaternion", *poses.quaternion(place))
    pose = messages.make("geometry_msgs/msg/Pose", point, turn)
    whole = messages.make("geometry_msgs/msg/PoseWithCovariance", pose, about.ravel())
    return messages.make(POSE, messages.header(at), whole)


def _location(
    messages: _Messages,
    at: int,
    row: dict[str, Any],
    poses: RoutePoses,
    about: Any,
    known: bool,
    lost: bool,
) -> Any:
    status = messages.make("sensor_msgs/msg/NavSatStatus", NO_FIX if lost else HAS_FIX, GPS)
    # Degrees are of the map's plane: its x is east and its y north.
    height = np.nan if poses.flat else float(poses.positions[row["place"], 2])
    spread, kind = about[:3, :3].ravel(), KNOWN if known else UNKNOWN
    where = row["latitude"], row["longitude"], height
    return messages.make(LOCATION, messages.header(at), status, *where, spread, kind)


def _schema(row: dict[str, Any]) -> bytes:
    """Of a row, in JSON Schema."""
    kinds = {bool: "boolean", int: "integer", float: "number", str: "string"}
    named = {name: {"type": kinds.get(type(value), "number")} for name, value in row.items()}
    return json.dumps({"title": "surefix.Fix", "type": "object", "properties": named}).encode()
