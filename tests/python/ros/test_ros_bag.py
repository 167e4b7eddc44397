"""The node's fixes are those of ``surefix run`` on a bag of the same messages."""

import csv
from pathlib import Path

import numpy as np
import pytest
from ros_messages import PERIOD, Messages, road
from rosbags.highlevel import AnyReader
from surefix_ros.localization import Localization

from commands import surefix_
from recordings import Bag


@pytest.mark.parametrize("options", [{}, {"motion": "steady", "sequence_length": 4}], ids=str)
def test_a_bag_has_the_fixes_of_its_messages(tmp_path: Path, options: dict[str, str]) -> None:
    file, _, images, positions = road(tmp_path)
    yaws = np.linspace(0, np.pi / 2, len(images))
    # There is a stop, a stretch backwards, and a gap.
    order = [*range(25), *[25] * 6, *range(25, 15, -1), *range(15, 40), *range(50, len(images))]
    with Bag(tmp_path, "mcap") as bag:
        for index, place in enumerate(order):
            time = 1000 + index * PERIOD + 3 * (place >= 50 and index > 60)
            turn = 0, 0, np.sin(yaws[place] / 2), np.cos(yaws[place] / 2)
            at = [*positions[place], 0]
            # Wheels are faster than the camera, and not at its times.
            bag.pose("/odom", "nav_msgs/msg/Odometry", at, time, turn)
            bag.image("/camera", images[place], time)
    flags = [
        part for name, value in options.items() for part in (f"--{name.replace('_', '-')}", value)
    ]
    fixes = tmp_path / "fixes.csv"
    surefix_(
        "run", file, bag.path, "--odometry", "/odom", "--gap", 1, "--accept", 0.95, "-o", fixes, *flags
    )  # fmt: skip
    with fixes.open(encoding="utf-8") as lines:
        rows = [*csv.DictReader(lines)]
    assert len(rows) == len(order)
    given = {"map": str(file), "odometry_topic": "/odom"}
    node = Localization(given | options)
    store = Messages().store
    read = 0
    with AnyReader([bag.path], default_typestore=store) as reader:
        for connection, _, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            if connection.topic == "/odom":
                node.odometry(message)
                continue
            answer = node.image(message)
            row = rows[read]
            read += 1
            assert answer is not None
            assert answer.fix.place == int(row["place"])
            assert answer.fix.trusted == (row["trusted"] == "true")
            assert answer.fix.confidence == pytest.approx(float(row["confidence"]), abs=2e-3)
            assert answer.accepted == (row["accepted"] == "true")
    assert read == len(rows)
    assert node.gaps == 1
