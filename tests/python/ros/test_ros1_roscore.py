"""The node's logic on real topics: of ROS 1, as Debian ships no ROS 2."""

import json
import os
import shutil
import socket
import subprocess
import sys
import time
import xmlrpc.client
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from ros_messages import PACKAGE, PERIOD, Messages, road
from surefix_ros.localization import Localization

HERE = Path(__file__).resolve().parent
DEBIAN = Path("/usr/lib/python3/dist-packages")
PACKAGES = ("rospy", "sensor_msgs", "geometry_msgs", "nav_msgs", "diagnostic_msgs")
ABSENT = [name for name in PACKAGES if not (DEBIAN / name).is_dir()]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        shutil.which("roscore") is None or bool(ABSENT),
        reason="no ROS 1 here: apt install python3-roslaunch python3-rospy python3-sensor-msgs "
        "python3-geometry-msgs python3-nav-msgs python3-diagnostic-msgs rosout",
    ),
]


@contextmanager
def running(command: list[str], log: Path, environment: dict[str, str]) -> Iterator[None]:
    with log.open("w") as file:
        process = subprocess.Popen(command, env=environment, stdout=file, stderr=file)
        try:
            yield
        finally:
            process.terminate()
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def master(uri: str) -> None:
    """Waits for the master."""
    until = time.monotonic() + 60
    while True:
        try:
            with xmlrpc.client.ServerProxy(uri) as proxy:
                proxy.getPid("/test")
            return
        except OSError:
            assert time.monotonic() < until, "roscore does not answer"
            time.sleep(0.1)


def test_a_drive_over_real_topics(tmp_path: Path) -> None:
    file, _, images, positions = road(tmp_path)
    times = 1_700_000_000 + np.arange(len(images)) * PERIOD
    yaws = np.linspace(0, np.pi / 2, len(images))
    np.savez(
        tmp_path / "drive.npz", images=images, poses=np.column_stack([positions, yaws]),
        stamps=np.column_stack([times.astype(np.int64), np.rint(times % 1 * 1e9).astype(np.int64)]),
    )  # fmt: skip
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    uri = f"http://127.0.0.1:{port}"
    environment = {
        **{name: value for name, value in os.environ.items() if not name.startswith("ROS_")},
        "ROS_MASTER_URI": uri, "ROS_IP": "127.0.0.1", "ROS_HOME": str(tmp_path / "ros"),
        "PYTHONPATH": os.pathsep.join([str(PACKAGE), *sys.path]),
    }  # fmt: skip
    # The tools of ROS run on the system's Python.
    plain = {name: value for name, value in environment.items() if name != "PYTHONPATH"}
    twin = [sys.executable, str(HERE / "ros1_twin.py")]
    with running([str(shutil.which("roscore")), "-p", str(port)], tmp_path / "core.log", plain):
        master(uri)
        with running([*twin, "node", str(file)], tmp_path / "node.log", environment):
            done = subprocess.run(
                [*twin, "camera", str(tmp_path)],
                env=environment, capture_output=True, text=True, timeout=120, check=False,
            )  # fmt: skip
    assert done.returncode == 0, (done.stderr, (tmp_path / "node.log").read_text())
    *poses, status = map(json.loads, done.stdout.splitlines())
    assert len(poses) == len(images)
    ros = Messages()
    local = Localization({"map": str(file), "odometry_topic": "/odom"})
    for position, yaw, moment in zip(positions, yaws, times, strict=True):
        local.odometry(ros.odometry(position, yaw, moment))
    for image, moment, pose in zip(images, times, poses, strict=True):
        answer = local.image(ros.image(image, moment))
        assert answer is not None
        assert answer.pose is not None
        assert pose["stamp"][0] == int(moment)
        assert pose["position"] == list(answer.pose.position)
        assert np.allclose(pose["covariance"], answer.pose.covariance, rtol=1e-3)
    assert (status["level"], status["message"]) == local.status()[:2]
    assert status["values"]["images"] == str(len(images))
