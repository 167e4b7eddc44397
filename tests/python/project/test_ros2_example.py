"""The ROS 2 example: the node's answers are made without ROS, and are tested here on real messages
of ROS 2.
"""

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

import surefix
from surefix.simulate import Route

FOLDER = Path(__file__).resolve().parents[3] / "examples" / "ros2"
STORE = get_typestore(Stores.ROS2_JAZZY)
PLACES = 60


@pytest.fixture(scope="module")
def route_pose() -> Any:
    sys.path.insert(0, str(FOLDER))
    try:
        import route_pose

        return route_pose
    finally:
        sys.path.remove(str(FOLDER))


@pytest.fixture(scope="module")
def drive() -> tuple[surefix.Map, list[np.ndarray]]:
    """A quarter of a circle of 100 m, and a second drive along it."""
    road = Route(places=PLACES, size=(96, 48))
    angle = np.linspace(0, math.pi / 2, PLACES)
    positions = 100 * np.stack([np.sin(angle), 1 - np.cos(angle)], axis=1)
    revisit = road.revisit()
    return surefix.Map.from_images(road.reference(), positions=positions), [
        revisit[i] for i in range(PLACES)
    ]


def message(image: np.ndarray, time: float, encoding: str = "rgb8") -> Any:
    """A sensor_msgs Image, through the wire format."""
    types = STORE.types
    stamp = types["builtin_interfaces/msg/Time"](int(time), round((time % 1) * 1e9))
    header = types["std_msgs/msg/Header"](stamp, "camera")
    height, width = image.shape[:2]
    whole = types["sensor_msgs/msg/Image"](
        header, height, width, encoding, 0, 3 * width, image.ravel()
    )
    return STORE.deserialize_cdr(STORE.serialize_cdr(whole, whole.__msgtype__), whole.__msgtype__)


def test_poses_are_those_of_the_fixes_of_the_images(
    route_pose: Any, drive: tuple[surefix.Map, list[Any]]
) -> None:
    route, images = drive
    assert route.positions is not None
    localizer = route_pose.RoutePose(route, sequence_length=3)
    plain = surefix.Localizer(route, sequence_length=3)
    spacing = np.median(np.linalg.norm(np.diff(route.positions, axis=0), axis=1))
    length = np.linalg.norm(np.diff(route.positions, axis=0), axis=1).sum()
    trusted = 0
    for index, image in enumerate(images):
        answer = localizer.push(message(image, 1000 + index / 8))
        fix = plain.push(image)
        assert answer.fix == fix
        assert answer.pose.position == (*route.positions[fix.place], 0)
        assert abs(answer.pose.yaw - fix.place / (PLACES - 1) * math.pi / 2) < 0.03
        covariance = answer.pose.covariance.reshape(6, 6)
        assert np.array_equal(covariance, np.diag(np.diag(covariance)))
        deviation = spacing if answer.trusted else length / math.sqrt(12)
        assert np.allclose(np.sqrt(np.diag(covariance))[:2], deviation)
        if answer.trusted:
            trusted += 1
            assert fix.trusted
            assert abs(fix.place - fix.single.place) <= 1
        expected = (
            (1, "warming up")
            if index < 2
            else ((0, "trusted") if answer.trusted else (1, "not trusted"))
        )
        assert (answer.level, answer.message) == expected
        assert answer.values["place"] == str(fix.place)
    assert 0 < trusted < PLACES


def test_the_answer_fits_the_messages_of_ros(
    route_pose: Any, drive: tuple[surefix.Map, list[Any]]
) -> None:
    route, images = drive
    answer = route_pose.RoutePose(route).push(message(images[0], 1.5))
    types = STORE.types
    point = types["geometry_msgs/msg/Point"](*answer.pose.position)
    turned = types["geometry_msgs/msg/Quaternion"](*answer.pose.quaternion)
    pose = types["geometry_msgs/msg/Pose"](point, turned)
    whole = types["geometry_msgs/msg/PoseWithCovariance"](pose, answer.pose.covariance)
    back = STORE.deserialize_cdr(STORE.serialize_cdr(whole, whole.__msgtype__), whole.__msgtype__)
    assert np.array_equal(back.covariance, answer.pose.covariance)
    values = [
        types["diagnostic_msgs/msg/KeyValue"](key, value) for key, value in answer.values.items()
    ]
    status = types["diagnostic_msgs/msg/DiagnosticStatus"](
        answer.level, "surefix", answer.message, "", values
    )
    again = STORE.deserialize_cdr(
        STORE.serialize_cdr(status, status.__msgtype__), status.__msgtype__
    )
    assert {value.key: value.value for value in again.values} == answer.values
    assert np.isclose(np.linalg.norm(answer.pose.quaternion), 1)


@pytest.mark.parametrize("jump", [3.0, -0.5])
def test_a_jump_of_the_stamps_is_a_gap(
    route_pose: Any, drive: tuple[surefix.Map, list[Any]], jump: float
) -> None:
    route, images = drive
    localizer = route_pose.RoutePose(route, gap=1.0, sequence_length=3)
    times = [1000 + index / 8 + (jump if index >= 5 else 0) for index in range(9)]
    answers = [
        localizer.push(message(image, time)) for image, time in zip(images, times, strict=False)
    ]
    warming = [index for index, answer in enumerate(answers) if answer.message == "warming up"]
    assert warming == [0, 1, 5, 6]
    assert [answer.values["gaps"] for answer in answers] == ["0"] * 5 + ["1"] * 4


def test_an_image_that_cannot_be_used_is_said_and_is_a_gap(
    route_pose: Any, drive: tuple[surefix.Map, list[Any]]
) -> None:
    route, images = drive
    localizer = route_pose.RoutePose(route)
    localizer.push(message(images[0], 1.0))
    localizer.push(message(images[1], 1.1))
    answer = localizer.push(message(images[2], 1.2, encoding="32FC1"))
    assert (answer.fix, answer.pose, answer.level) == (None, None, 2)
    assert "32FC1" in answer.message
    assert answer.values == {"gaps": "1", "refused images": "1"}
    assert localizer.push(message(images[3], 1.3)).message == "warming up"


def test_a_map_without_positions_is_refused(
    route_pose: Any, drive: tuple[surefix.Map, list[Any]]
) -> None:
    with pytest.raises(surefix.SurefixValueError, match="expected one with positions"):
        route_pose.RoutePose(surefix.Map.from_images(drive[1]))


def test_without_ros_the_node_says_so() -> None:
    found = subprocess.run([sys.executable, "-c", "import rclpy"], capture_output=True, check=False)
    if found.returncode == 0:
        pytest.skip("ROS 2 is installed here")
    node = [sys.executable, str(FOLDER / "localizer_node.py")]
    done = subprocess.run(node, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("localizer_node: needs a ROS 2 installation")
    assert done.stderr.count("\n") == 1
