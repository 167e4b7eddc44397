"""What the ROS 2 node answers: its logic on real messages of ROS 2, without ROS."""

import io
import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import pytest
from PIL import Image
from ros_messages import DISTRIBUTIONS, PERIOD, PLACES, Drive, Messages, road
from surefix_ros import messages
from surefix_ros.localization import ERROR, OK, WARN, Localization

import surefix
from surefix.simulate import Route

START = 1_700_000_000.0
ROS = Messages()


@pytest.mark.parametrize("motion", ["any", "steady", "none"])
def test_an_entire_drive_has_the_fixes_of_a_localizer(drive: Drive, motion: str) -> None:
    file, route, images, _ = drive
    node = Localization({"map": str(file), "motion": motion, "sequence_length": 3})
    plain = surefix.Localizer(route, sequence_length=3, motion=None if motion == "none" else motion)
    for index, image in enumerate(images):
        answer = node.image(ROS.image(image, START + index * PERIOD))
        assert answer is not None
        assert answer.fix == plain.push(image)
        assert answer.advance is None
    assert node.status().values["images"] == str(PLACES)
    assert node.gaps == node.refused == 0


def test_the_covariance_is_the_second_moment_under_the_belief(drive: Drive) -> None:
    file, route, images, positions = drive
    node = Localization({"map": str(file)})
    plain = surefix.Localizer(route, motion="any")
    spacing = np.median(np.linalg.norm(np.diff(positions, axis=0), axis=1))
    extent = np.linalg.norm(np.ptp(positions, axis=0))
    sigmas = []
    for index, image in enumerate(images):
        answer = node.image(ROS.image(image, START + index * PERIOD))
        fix = plain.push(image)
        assert answer is not None
        assert answer.pose is not None
        belief, off = plain.belief, fix.off_map
        assert belief is not None
        assert off is not None
        assert answer.pose.position == (*positions[fix.place], 0)
        expected = ((off > 0.2) * extent**2 + spacing**2 / 12) * np.eye(2)
        for place, probability in enumerate(belief / belief.sum()):
            away = positions[place] - positions[fix.place]
            expected += probability * np.outer(away, away)
        covariance = answer.pose.covariance.reshape(6, 6)
        assert np.allclose(covariance[:2, :2], expected)
        assert np.allclose(covariance, covariance.T)
        assert (np.linalg.eigvalsh(covariance) > 0).all()
        assert covariance[2, 2] == 1e6
        assert abs(answer.pose.yaw - fix.place / (PLACES - 1) * math.pi / 2) < 0.03
        sigmas.append(math.sqrt(covariance[0, 0] + covariance[1, 1]))
    # At first it may be anywhere; once it is sure, it is within some metres.
    assert sigmas[0] > 20
    assert np.median(sigmas[-10:]) < 5


def test_off_the_map_the_pose_says_that_it_knows_nothing(drive: Drive) -> None:
    file, _, images, positions = drive
    node = Localization({"map": str(file), "motion": "steady"})
    for index, image in enumerate(images[:40]):
        node.image(ROS.image(image, START + index * PERIOD))
    assert node.answer is not None
    assert node.answer.accepted
    assert node.status()[:2] == (OK, "accepted")
    sure = math.sqrt(node.answer.pose.covariance[0])
    lost, said = [], []
    # Another road.
    for index, image in enumerate(Route(places=PLACES, size=(96, 48), seed=99).reference()):
        answer = node.image(ROS.image(image, START + (40 + index) * PERIOD))
        assert answer is not None
        extent = np.linalg.norm(np.ptp(positions, axis=0))
        off = answer.fix.off_map > 0.2
        assert (math.sqrt(answer.pose.covariance[0]) > extent) == off
        assert not (off and answer.accepted)
        lost.append(math.sqrt(answer.pose.covariance[0]))
        said.append(node.status()[:2] == (WARN, "perhaps off the map"))
        assert said[-1] == off
    assert sum(said) > 5
    assert np.median(lost[10:]) > 5 * sure


def test_headings_do_not_cross_a_break_and_go_round_a_ring(tmp_path: Path) -> None:
    from surefix.tables.route_poses import headings

    angle = np.arange(8) / 8 * 2 * math.pi
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    # Eastwards, with a stop; far away a ring.
    line = np.array(
        [[-9.0, 50, 0], [-8, 50, 0], [-7, 50, 0], [-7, 50, 0], [-7, 50, 0], [-6, 50, 0]]
    )
    segments = surefix.Segments(14, breaks=[6], closed=[1])
    found = headings(np.concatenate([line, ring]), segments)
    assert np.allclose(found[:6], 0)
    assert np.allclose(np.unwrap(found[6:]), angle + math.pi / 2)


@pytest.mark.parametrize("jump", [3.0, -0.5])
def test_a_jump_of_the_time_is_a_gap(drive: Drive, jump: float) -> None:
    file, _, images, _ = drive
    node = Localization({"map": str(file), "motion": "none", "sequence_length": 3})
    warming = []
    for index in range(9):
        time = START + index * PERIOD + (jump if index >= 5 else 0)
        answer = node.image(ROS.image(images[index], time))
        assert answer is not None
        warming += [index] if answer.fix.sequence is None else []
    assert warming == [0, 1, 5, 6]
    assert node.gaps == 1


def test_a_gap_and_a_reset_by_hand(drive: Drive) -> None:
    file, _, images, _ = drive
    node = Localization({"map": str(file), "motion": "none"})
    stamps = iter(START + index * PERIOD for index in range(99))

    def ready(image: np.ndarray) -> bool:
        answer = node.image(ROS.image(image, next(stamps)))
        assert answer is not None
        return answer.fix.sequence is not None

    assert [ready(image) for image in images[:3]] == [False, True, True]
    node.gap()
    assert [ready(image) for image in images[3:5]] == [False, True]
    assert node.answer.fix.frame == 4
    assert node.image(ROS.image(images[5], START + 5 * PERIOD, encoding="none")) is None
    assert node.status().level == ERROR
    node.reset()
    assert node.status().message == "no image yet"
    assert not ready(images[5])
    assert node.answer.fix.frame == 0
    assert node.gaps == 1


def test_an_image_that_cannot_be_used_is_said_and_passed_over(drive: Drive) -> None:
    file, route, images, _ = drive
    node = Localization({"map": str(file), "motion": "steady"})
    plain = surefix.Localizer(route, motion="steady")
    node.image(ROS.image(images[0], START))
    assert node.image(ROS.image(images[1], START + 0.1, encoding="jpeg2000")) is None
    assert "'jpeg2000'" in node.problem
    assert node.status()[:2] == (ERROR, node.problem)
    short = ROS.image(images[1], START + 0.2)
    short.data = short.data[:100]
    assert node.image(short) is None
    assert "100 bytes" in node.problem
    bad = ROS.compressed(b"no picture", "jpeg", START + 0.3)
    assert node.image(bad) is None
    answer = node.image(ROS.image(images[1], START + 0.4))
    plain.push(images[0])
    assert answer is not None
    assert answer.fix == plain.push(images[1])
    assert node.problem == ""
    assert node.status().values["refused images"] == "3"


def test_compressed_images_and_images_without_a_stamp(drive: Drive) -> None:
    file, route, images, _ = drive
    node = Localization({"map": str(file), "motion": "none", "sequence_length": 2})
    plain = surefix.Localizer(route, sequence_length=2)
    for index, image in enumerate(images[:4]):
        data = io.BytesIO()
        Image.fromarray(image).save(data, "PNG")
        message = ROS.compressed(data.getvalue(), "rgb8; png compressed", 0.0)
        # Times at which they were received: a gap before the last.
        answer = node.image(message, received=START + index * PERIOD + 9 * (index == 3))
        if index == 3:
            plain.gap()
        assert answer is not None
        assert answer.fix == plain.push(image)


def test_images_by_time_and_by_distance(drive: Drive) -> None:
    file, _, images, _ = drive
    by_time = Localization({"map": str(file), "every": 0.25})
    by_metres = Localization({"map": str(file), "odometry_topic": "odom", "metres": 4.0})
    taken: dict[str, list[int]] = {"time": [], "metres": []}
    for index in range(12):
        message = ROS.image(images[index], START + index * PERIOD)
        by_metres.odometry(ROS.odometry(np.array([1.5 * index, 0]), 0, START + index * PERIOD))
        taken["time"] += [] if by_time.image(message) is None else [index]
        taken["metres"] += [] if by_metres.image(message) is None else [index]
    assert taken == {"time": [0, 2, 4, 6, 8, 10], "metres": [0, 3, 6, 9]}
    assert by_time.problem == by_metres.problem == ""


def test_the_threshold_of_settings_accepts(drive: Drive, tmp_path: Path) -> None:
    file, route, images, _ = drive
    run = surefix.match(route, images, motion="steady")
    truth = np.arange(PLACES)
    threshold = surefix.calibrate(run, truth, wrong=0.3, sure=0.8)
    config = tmp_path / "route.toml"
    surefix.Settings(threshold=threshold, maps=route, motion="steady").save(config)
    node = Localization({"map": str(file), "config": str(config)})
    plain = surefix.Localizer(route, config=config)
    for index, image in enumerate(images):
        answer = node.image(ROS.image(image, START + index * PERIOD))
        fix = plain.push(image)
        assert answer is not None
        assert answer.fix == fix
        assert answer.accepted == fix.accepted
    assert node.status().values["alarm"] == "False"
    with pytest.raises(surefix.SurefixError, match="weight"):
        Localization({"map": str(file), "config": str(config), "weight": 0.5})


@pytest.mark.parametrize("distribution", DISTRIBUTIONS, ids=lambda each: each.name)
def test_what_is_published_fits_the_messages_of_ros(tmp_path: Path, distribution: Any) -> None:
    file, route, images, positions = road(tmp_path, origin=(51.5, -0.12))
    ros = Messages(distribution)
    node = Localization({"map": str(file)})
    for index, image in enumerate(images[:20]):
        answer = node.image(ros.image(image, START + index * PERIOD))
    assert answer is not None
    head = messages.header(ros.make, ros.stamp(START + 0.25), "map")
    pose = ros.wired(messages.pose(ros.make, head, answer.pose))
    assert (pose.header.frame_id, pose.header.stamp) == ("map", head.stamp)
    assert (pose.pose.pose.position.x, pose.pose.pose.position.y) == tuple(
        positions[answer.fix.place]
    )
    assert np.array_equal(pose.pose.covariance, answer.pose.covariance)
    turn = pose.pose.pose.orientation
    assert 2 * math.atan2(turn.z, turn.w) == pytest.approx(answer.pose.yaw)
    array = ros.wired(messages.route(ros.make, head, node.poses))
    assert [(each.position.x, each.position.y) for each in array.poses] == [*map(tuple, positions)]
    degrees = ros.wired(messages.nav_sat_fix(ros.make, head, answer))
    assert (degrees.latitude, degrees.longitude) == tuple(route.degrees[answer.fix.place])
    assert degrees.status.status == (0 if answer.accepted else -1)
    assert np.allclose(
        degrees.position_covariance.reshape(3, 3), answer.pose.covariance.reshape(6, 6)[:3, :3]
    )
    fix = ros.wired(messages.fix(ros.make, head, answer))
    assert (fix.frame, fix.place, fix.segment) == (19, answer.fix.place, 0)
    assert (fix.trusted, fix.accepted) == (answer.fix.trusted, answer.accepted)
    assert fix.confidence == np.float32(answer.fix.confidence)
    assert math.isnan(fix.advance)
    assert 0 < fix.latency < 60
    status = node.status()
    made = messages.diagnostics(ros.make, head, "surefix: localization", status, status.level)
    told = ros.wired(made).status[0]
    assert (told.level, told.message) == status[:2]
    assert {each.key: each.value for each in told.values} == status.values
    assert float(status.values["latency, most (ms)"]) > 0


def test_without_positions_there_are_fixes_and_no_poses(tmp_path: Path, drive: Drive) -> None:
    _, _, images, _ = drive
    file = tmp_path / "plain.safetensors"
    surefix.Map.from_images(images).save(file)
    node = Localization({"map": str(file)})
    answer = node.image(ROS.image(images[0], START))
    assert answer is not None
    assert answer.pose is None
    head = ROS.header(START)
    assert messages.nav_sat_fix(ROS.make, head, answer) is None
    with pytest.raises(surefix.SurefixValueError, match="parameter places_per_metre: expected"):
        Localization({"map": str(file), "odometry_topic": "odom"})


def test_the_status_may_be_asked_while_an_image_is_localized(drive: Drive, tmp_path: Path) -> None:
    file, route, images, _ = drive
    run = surefix.match(route, images, motion="steady")
    threshold = surefix.calibrate(run, np.arange(PLACES), wrong=0.3, sure=0.8)
    config = tmp_path / "route.toml"
    surefix.Settings(threshold=threshold, maps=route, motion="steady").save(config)
    node = Localization({"map": str(file), "config": str(config), "odometry_topic": "odom"})
    ended = Event()

    def ask() -> int:
        count = 0
        while not ended.is_set():
            node.status()
            node.odometry(ROS.odometry(np.array([0.1 * count, 0]), 0, START + 0.01 * count))
            count += 1
        return count

    with ThreadPoolExecutor() as pool:
        asked = [pool.submit(ask) for _ in range(2)]
        for index in range(500):
            assert node.image(ROS.image(images[index % PLACES], START + index * PERIOD))
        ended.set()
        assert all(each.result() > 0 for each in asked)
