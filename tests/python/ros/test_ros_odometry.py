"""The node's logic with odometry: messages of nav_msgs become advances of the track."""

import math

import numpy as np
import pytest
from ros_messages import PERIOD, PLACES, Drive, Messages
from surefix_ros.localization import WARN, Localization

import surefix

START = 1_700_000_000.0
ROS = Messages()


def yaws() -> np.ndarray:
    return np.linspace(0, math.pi / 2, PLACES)


def test_by_odometry_the_fixes_are_those_of_the_advances(drive: Drive) -> None:
    file, route, images, positions = drive
    node = Localization({"map": str(file), "odometry_topic": "odom"})
    plain = surefix.Localizer(route, motion="any")
    assert route.places_per_metre is not None
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(positions, axis=0), axis=1))])
    # The robot goes to place 30, stands for 5 images, goes back for 10, and on.
    order = [*range(31), *[30] * 5, *range(30, 20, -1), *range(20, PLACES)]
    before = None
    for index, place in enumerate(order):
        time = START + index * PERIOD
        node.odometry(ROS.odometry(positions[place], yaws()[place], time))
        advance = (
            None if before is None else (along[place] - along[before]) * route.places_per_metre
        )
        answer = node.image(ROS.image(images[place], time))
        fix = plain.push(images[place], advance=advance)
        assert answer is not None
        if advance is None:
            assert answer.advance is None
        else:
            assert answer.advance == pytest.approx(advance, abs=1e-5)
        assert answer.fix.place == fix.place
        assert answer.fix.confidence == pytest.approx(fix.confidence, abs=1e-4)
        before = place
    assert abs(answer.fix.place - order[-1]) <= 1


@pytest.mark.parametrize("turned", [True, False])
def test_odometry_that_reverses_is_seen_by_the_heading_or_the_speed(
    drive: Drive, turned: bool
) -> None:
    file, _, images, _ = drive
    node = Localization({"map": str(file), "odometry_topic": "odom", "places_per_metre": 0.5})
    advances = []
    for index, x in enumerate([0.0, 2.0, 4.0, 3.0, 1.0, 1.0, 1.5]):
        time, speed = START + index * PERIOD, -1.0 if index in (3, 4) else 1.0
        node.odometry(ROS.odometry(np.array([x, 0.0]), 0.0, time, speed, turned))
        answer = node.image(ROS.image(images[index], time))
        assert answer is not None
        advances.append(answer.advance)
    assert advances[0] is None
    assert advances[1:] == pytest.approx([1, 1, -0.5, -1, 0, 0.25])


def test_a_robot_that_calls_back_what_the_route_calls_forward(drive: Drive) -> None:
    file, _, images, _ = drive
    forwards, backwards = (
        Localization({"map": str(file), "odometry_topic": "odom", "places_per_metre": scale})
        for scale in (0.4, -0.4)
    )
    for index in range(4):
        time = START + index * PERIOD
        for node in (forwards, backwards):
            node.odometry(ROS.odometry(np.array([-float(index), 0]), 0.0, time))
            answer = node.image(ROS.image(images[index], time))
            assert answer is not None
            if index:
                assert answer.advance == pytest.approx(-0.4 if node is forwards else 0.4)
    one, other = (node.answer.pose.yaw for node in (forwards, backwards))
    assert abs(one - other) == pytest.approx(math.pi)


def test_odometry_between_its_messages_and_a_little_beyond(drive: Drive) -> None:
    file, _, images, _ = drive
    node = Localization({"map": str(file), "odometry_topic": "odom", "places_per_metre": 1.0})
    for index in range(5):
        node.odometry(ROS.odometry(np.array([3.0 * index, 0.0]), 0.0, START + index))
    for time, metres in ((0.5, 1.5), (1.25, 3.75), (4.0, 12.0), (4.4, 13.2)):
        mark = node.travel.at(START + time)
        assert mark is not None
        assert mark.metres == pytest.approx(metres, abs=1e-5)
    assert node.travel.at(START - 0.1) is node.travel.at(START + 4.6) is None
    node.image(ROS.image(images[0], START + 9))
    node.image(ROS.image(images[1], START + 9.1))
    assert node.status()[:2] == (WARN, "no odometry at the time of the image")


def test_an_odometry_that_starts_anew_is_no_advance(drive: Drive) -> None:
    file, _, images, _ = drive
    node = Localization({"map": str(file), "odometry_topic": "odom", "places_per_metre": 1.0})
    advances = []
    for index, x in enumerate([500.0, 501.0, 0.0, 1.0, math.nan, 3.0]):
        time = START + index * PERIOD
        node.odometry(ROS.odometry(np.array([x, 0.0]), 0.0, time))
        answer = node.image(ROS.image(images[index], time))
        assert answer is not None
        advances.append(answer.advance)
    assert advances[0] is advances[2] is None
    # The message with NaN is left out: the speed before it goes on, and is made up for.
    assert advances[1::2] == pytest.approx([1, 1, 1], abs=1e-5)
    assert advances[4] == pytest.approx(1, abs=1e-5)
    assert node.travel.refused == 1


def test_odometry_bridges_a_gap(drive: Drive) -> None:
    file, _, images, positions = drive
    node = Localization({"map": str(file), "odometry_topic": "odom", "gap": 0.5})
    for index in [*range(25), *range(40, 45)]:
        time = START + index * PERIOD
        node.odometry(ROS.odometry(positions[index], yaws()[index], time))
        answer = node.image(ROS.image(images[index], time))
    assert node.gaps == 1
    assert answer is not None
    assert answer.accepted
    assert abs(answer.fix.place - 44) <= 1


def test_a_robot_that_stands_is_no_gap(drive: Drive) -> None:
    file, _, images, positions = drive
    node = Localization({"map": str(file), "odometry_topic": "odom", "metres": 1.0})
    slow = Localization({"map": str(file), "every": 2.5})
    taken = 0
    order = [*range(10), *[9] * 40, *range(10, 20)]
    for index, place in enumerate(order):
        time = START + index * PERIOD
        node.odometry(ROS.odometry(positions[place], yaws()[place], time))
        taken += node.image(ROS.image(images[place], time)) is not None
        slow.image(ROS.image(images[place], time))
    assert taken == 20
    assert node.gaps == slow.gaps == 0
    # The camera was away.
    for each in (node, slow):
        each.image(ROS.image(images[20], time + 4))
        assert each.gaps == 1


def test_odometry_that_would_do_nothing_is_refused(drive: Drive) -> None:
    given = {"map": str(drive[0]), "odometry_topic": "odom", "motion": "none"}
    with pytest.raises(surefix.SurefixValueError, match="parameter odometry_topic: expected a mot"):
        Localization(given)
    assert Localization(given | {"metres": 2}).by_odometry
