"""The node and its launch file, run on a stand-in for rclpy and launch with real messages."""

import importlib
import importlib.util
import json
import re
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import fake_ros
import numpy as np
import pytest
from PIL import Image
from ros_messages import PACKAGE, PERIOD, Messages, road
from surefix_ros.parameters import PARAMETERS

import surefix

START = 1_700_000_000.0
ROS = Messages()


class Running:
    """What is done while ``rclpy.spin`` runs, and the node that it was done to."""

    def __init__(self, body: Callable[[Any], None]) -> None:
        self.body, self.node = body, None

    def __call__(self, node: Any) -> None:
        self.node = node
        self.body(node)
        raise KeyboardInterrupt


def run(
    monkeypatch: pytest.MonkeyPatch, parameters: dict[str, Any], body: Callable[[Any], None]
) -> Any:
    """Runs ``main`` of the node with these parameters, and returns the node when it has ended."""
    spin = Running(body)
    state = fake_ros.install(monkeypatch, ROS, spin)
    monkeypatch.setattr(fake_ros.Node, "parameters", parameters)
    importlib.import_module("surefix_ros.node").main()
    node: Any = spin.node
    assert not state.ok
    assert node.destroyed
    assert all(not thread.is_alive() for thread in node.worker._threads)
    return node


def wait_for(done: Callable[[], bool]) -> None:
    until = time.monotonic() + 30
    while not done():
        assert time.monotonic() < until, "the node did not answer"
        time.sleep(0.001)


def test_a_drive_through_the_node(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    file, route, images, positions = road(tmp_path, origin=(51.5, -0.12))
    plain = surefix.Localizer(route, motion="any")
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(positions, axis=0), axis=1))])
    assert route.places_per_metre is not None
    places: list[int] = []

    def drive(node: Any) -> None:
        kind, take = node.subscriptions["/camera"]
        assert kind.__name__ == "Image"
        _, move = node.subscriptions["/odom"]
        for index, image in enumerate(images):
            move(ROS.odometry(positions[index], index * 0.0266, START + index * PERIOD))
            take(ROS.image(image, START + index * PERIOD))
            wait_for(lambda index=index: len(node.publishers["~/navsat"]) > index)
            moved = None if not index else (along[index] - along[index - 1])
            advance = None if moved is None else moved * route.places_per_metre
            places.append(plain.push(image, advance=advance).place)
        take(ROS.image(images[0], START + 8, encoding="none such"))
        wait_for(lambda: bool(node.logger.said))
        for _, tell in node.timers:
            tell()

    given = {"map": str(file), "image_topic": "/camera", "odometry_topic": "/odom", "frame_id": "w"}
    node = run(monkeypatch, given, drive)
    assert [each.place for each in node.publishers["~/fix"]] == places
    poses = node.publishers["~/pose"]
    assert len(poses) == len(images)
    for index, message in enumerate(poses):
        assert message.header.frame_id == "w"
        assert message.header.stamp == ROS.image(images[0], START + index * PERIOD).header.stamp
        assert message.pose.pose.position.x == positions[places[index]][0]
    assert len(node.publishers["~/route"][0].poses) == len(route)
    assert node.qualities["~/route"].durability == "transient_local"
    assert node.qualities["/camera"].reliability == "best_effort"
    assert "'none such'" in node.logger.said[0]
    told = node.publishers["/diagnostics"][0].status[0]
    assert (told.level, told.name) == (b"\2", "surefix: localization")
    assert "'none such'" in told.message
    assert {each.name for each in PARAMETERS} == {*node.declared}
    assert all(each.read_only and each.description for each in node.declared.values())


def test_accepted_poses_only_and_the_services(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    file, _, images, _ = road(tmp_path)

    def drive(node: Any) -> None:
        kind, take = node.subscriptions["/camera/compressed"]
        assert kind.__name__ == "CompressedImage"
        assert node.qualities["/camera/compressed"].reliability == "reliable"
        for index, image in enumerate(images):
            file = tmp_path / "image.png"
            Image.fromarray(image).save(file)
            take(ROS.compressed(file.read_bytes(), "png", 0.0 if index == 5 else START + index))
            wait_for(lambda index=index: len(node.publishers["~/fix"]) > index)
            if index == 40:
                for name in ("~/gap", "~/reset"):
                    answer = node.services[name](None, SimpleNamespace())
                    assert answer.success
                    assert answer.message

    given = {
        "map": str(file), "image_topic": "/camera", "image_transport": "compressed",
        "image_reliability": "reliable", "accepted_only": True, "motion": "steady", "gap": 2,
    }  # fmt: skip
    node = run(monkeypatch, given, drive)
    fixes, poses = node.publishers["~/fix"], node.publishers["~/pose"]
    accepted = [each for each in fixes if each.accepted]
    assert 0 < len(accepted) < len(fixes)
    assert [each.header.stamp for each in poses] == [each.header.stamp for each in accepted]
    # Without a stamp it is the node's clock.
    assert fixes[5].header.stamp.sec == 12
    assert [each.frame for each in fixes[39:43]] == [39, 40, 0, 1]
    assert not node.publishers["~/navsat"]


def test_a_slow_node_takes_the_newest_image(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    file, _, images, _ = road(tmp_path)

    def drive(node: Any) -> None:
        _, take = node.subscriptions["image"]
        with node.localization._lock:
            take(ROS.image(images[0], START))
            # It waits for the lock, as if it was slow.
            wait_for(node.waiting.empty)
            for index in range(1, 6):
                take(ROS.image(images[index], START + index * PERIOD))
        wait_for(lambda: len(node.publishers["~/fix"]) == 2)

    node = run(monkeypatch, {"map": str(file)}, drive)
    assert [each.header.stamp.nanosec for each in node.publishers["~/fix"]] == [
        ROS.stamp(START + index * PERIOD).nanosec for index in (0, 5)
    ]
    assert node.localization.status().values["dropped images"] == "4"


def test_a_wrong_parameter_ends_the_node_with_one_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with pytest.raises(SystemExit) as end:
        run(monkeypatch, {"map": str(tmp_path / "gone")}, lambda node: None)
    assert re.fullmatch(r"surefix: .*gone: cannot read the map: .*", str(end.value.code))
    with pytest.raises(SystemExit, match=r"^surefix: Invalid topic name: 'my camera'$"):
        run(monkeypatch, {"map": str(road(tmp_path)[0]), "image_topic": "my camera"}, print)


def test_an_error_of_the_worker_is_not_lost(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    file, _, images, _ = road(tmp_path)

    def drive(node: Any) -> None:
        node.localization.image = lambda message, now: 1 / 0
        node.subscriptions["image"][1](ROS.image(images[0], START))
        wait_for(lambda: node.error is not None)
        raise fake_ros.ExternalShutdownException

    with pytest.raises(ZeroDivisionError):
        run(monkeypatch, {"map": str(file)}, drive)


def launched(monkeypatch: pytest.MonkeyPatch, **given: str) -> SimpleNamespace:
    fake_ros.install_launch(monkeypatch)
    path = PACKAGE / "launch" / "localizer.launch.py"
    spec = importlib.util.spec_from_file_location("localizer_launch", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    *arguments, start = module.generate_launch_description()
    defaults = {name: default for name, default, _ in arguments}
    assert {*defaults} == {each.name for each in PARAMETERS} | {"params_file"}
    assert all(isinstance(default, str) for default in defaults.values())
    (node,) = start(defaults | given)
    assert isinstance(node, SimpleNamespace)
    return node


def test_the_launch_file_has_every_parameter_as_an_argument(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    node = launched(monkeypatch)
    assert (node.package, node.executable) == ("surefix_ros", "localizer")
    assert node.parameters == []
    node = launched(
        monkeypatch, map="7", weight="0.5", speeds="[0.5, 1.0]", floor="0.2", accepted_only="true",
        motion="none", fuse="[a, b]", technique_weights="[1, 0.5]", params_file="p.yaml",
    )  # fmt: skip
    changed = {
        "map": "7", "weight": 0.5, "speeds": [0.5, 1.0], "floor": 0.2, "accepted_only": True,
        "motion": "none", "fuse": ["a", "b"], "technique_weights": [1.0, 0.5],
    }  # fmt: skip
    assert node.parameters == ["p.yaml", changed]
    # Of one type: launch refuses others.
    assert all(type(each) is float for each in node.parameters[1]["technique_weights"])
    with pytest.raises(surefix.SurefixError, match="parameter weight: expected a number"):
        launched(monkeypatch, weight="heavy")


def test_the_layout_shows_topics_of_the_node() -> None:
    layout = json.loads((PACKAGE / "foxglove" / "surefix.json").read_text(encoding="utf-8"))
    configured = layout["configById"]

    def panels(part: Any) -> list[str]:
        if isinstance(part, str):
            return [part]
        assert part["direction"] in ("row", "column")
        return [*panels(part["first"]), *panels(part["second"])]

    shown = panels(layout["layout"])
    assert sorted(shown) == sorted(configured)
    # The names of Foxglove's panels, and Lichtblick's.
    known = {"3D", "DiagnosticSummary", "Image", "Plot", "StateTransitions", "map"}
    assert {name.partition("!")[0] for name in shown} <= known
    message = (PACKAGE.parent / "surefix_msgs" / "msg" / "Fix.msg").read_text(encoding="utf-8")
    fields = re.findall(r"^[\w/]+ (\w+)$", message, re.MULTILINE)
    text = json.dumps(layout)
    plotted = re.findall(r'"value": "/surefix/fix\.(\w+)"', text)
    assert plotted
    assert {*plotted} <= {*fields}
    topics = {*re.findall(r'"(/[\w/]+)"', text)}
    assert {"/surefix/pose", "/surefix/route", "/diagnostics"} <= topics
