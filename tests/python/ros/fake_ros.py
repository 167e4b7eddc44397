"""As much of rclpy and of launch as the node and its launch file call, with rosbags' messages.

It stands in for a ROS installation, so that both files run in tests. It knows the calls by their
names in ROS 2, and refuses others.
"""

import sys
from types import ModuleType, SimpleNamespace
from typing import Any, ClassVar

import pytest
from ros_messages import Messages

MODULES = (
    "diagnostic_msgs", "geometry_msgs", "nav_msgs", "sensor_msgs", "std_msgs", "surefix_msgs",
)  # fmt: skip


class Logger:
    def __init__(self) -> None:
        self.said: list[str] = []

    def warning(self, text: str, throttle_duration_sec: float) -> None:
        self.said.append(text)


class Node:
    """A node that keeps all that it is asked for; ``parameters`` are those given from outside."""

    parameters: ClassVar[dict[str, Any]] = {}
    made: ClassVar[list[Any]] = []

    def __init__(self, name: str) -> None:
        self.name = name
        self.publishers: dict[str, list[Any]] = {}
        self.qualities: dict[str, Any] = {}
        self.subscriptions: dict[str, tuple[type, Any]] = {}
        self.services: dict[str, Any] = {}
        self.timers: list[tuple[float, Any]] = []
        self.declared: dict[str, SimpleNamespace] = {}
        self.logger, self.destroyed, self.seconds = Logger(), False, 12.0
        Node.made.append(self)

    def declare_parameter(self, name: str, value: Any, descriptor: Any) -> SimpleNamespace:
        self.declared[name] = descriptor
        return SimpleNamespace(value=self.parameters.get(name, value))

    def create_publisher(self, kind: type, topic: str, quality: Any) -> SimpleNamespace:
        sent = self.publishers.setdefault(topic, [])
        self.qualities[topic] = quality

        def publish(message: Any) -> None:
            assert isinstance(message, kind)
            sent.append(message)

        return SimpleNamespace(publish=publish)

    def create_subscription(self, kind: type, topic: str, callback: Any, quality: Any) -> None:
        if " " in topic:
            raise NameValidationException(f"Invalid topic name:\n  {topic!r}")
        self.subscriptions[topic] = kind, callback
        self.qualities[topic] = quality

    def create_service(self, kind: type, name: str, callback: Any) -> None:
        self.services[name] = callback

    def create_timer(self, period: float, callback: Any) -> None:
        self.timers.append((period, callback))

    def get_clock(self) -> SimpleNamespace:
        time = Messages().stamp(self.seconds)
        moment = SimpleNamespace(nanoseconds=round(self.seconds * 1e9), to_msg=lambda: time)
        return SimpleNamespace(now=lambda: moment)

    def get_logger(self) -> Logger:
        return self.logger

    def get_name(self) -> str:
        return self.name

    def destroy_node(self) -> None:
        self.destroyed = True


class NameValidationException(ValueError):  # noqa: N818 (rclpy's name)
    """As in rclpy."""


class ExternalShutdownException(Exception):  # noqa: N818 (rclpy's name)
    """As in rclpy."""


def install(monkeypatch: pytest.MonkeyPatch, ros: Messages, spin: Any) -> SimpleNamespace:
    """Puts the modules where the node looks for them, for one test; returns whether ROS runs."""
    state = SimpleNamespace(ok=False)

    def module(name: str, **names: Any) -> None:
        made = ModuleType(name)
        vars(made).update(names)
        monkeypatch.setitem(sys.modules, name, made)

    class Byte(ros.store.types["diagnostic_msgs/msg/DiagnosticStatus"]):  # type: ignore[misc]
        """rclpy takes a byte as bytes."""

        def __post_init__(self) -> None:
            assert isinstance(self.level, bytes)
            assert len(self.level) == 1

    for package in MODULES:
        found = {
            kind.rpartition("/")[2]: each
            for kind, each in ros.store.types.items()
            if kind.startswith(f"{package}/msg/")
        }
        named = {}
        for name, each in found.items():
            base = Byte if name == "DiagnosticStatus" else each
            # rclpy's classes are named as their messages are.
            named[name] = type(name, (base,), {"__module__": f"{package}.msg._{name.lower()}"})
        module(package)
        module(f"{package}.msg", **named)
    policies = {
        "DurabilityPolicy": SimpleNamespace(TRANSIENT_LOCAL="transient_local"),
        "HistoryPolicy": SimpleNamespace(KEEP_LAST="keep_last"),
    }
    reliability = type("Reliability", (dict,), {"BEST_EFFORT": "best_effort"})
    policies["ReliabilityPolicy"] = reliability(BEST_EFFORT="best_effort", RELIABLE="reliable")

    def init() -> None:
        state.ok = True

    def try_shutdown() -> None:
        state.ok = False

    module("rcl_interfaces")
    module("rcl_interfaces.msg", ParameterDescriptor=SimpleNamespace)
    module("std_srvs")
    trigger = SimpleNamespace(Request=SimpleNamespace, Response=SimpleNamespace)
    module("std_srvs.srv", Trigger=trigger)
    calls = {"init": init, "try_shutdown": try_shutdown, "ok": lambda: state.ok, "spin": spin}
    module("rclpy", **calls)
    module("rclpy.node", Node=Node)
    module("rclpy.qos", QoSProfile=SimpleNamespace, **policies)
    module("rclpy.exceptions", NameValidationException=NameValidationException)
    module("rclpy.executors", ExternalShutdownException=ExternalShutdownException)
    monkeypatch.delitem(sys.modules, "surefix_ros.node", raising=False)
    monkeypatch.setattr(Node, "made", [])
    return state


def install_launch(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same for the launch file."""

    def argument(name: str, default_value: str, description: str) -> tuple[str, str, str]:
        return name, default_value, description

    def configuration(name: str) -> SimpleNamespace:
        return SimpleNamespace(perform=lambda context: context[name])

    parts: dict[str, dict[str, Any]] = {
        "launch": {"LaunchContext": dict, "LaunchDescription": list},
        "launch.actions": {
            "DeclareLaunchArgument": argument,
            "OpaqueFunction": lambda function: function,
        },
        "launch.substitutions": {"LaunchConfiguration": configuration},
        "launch_ros": {},
        "launch_ros.actions": {"Node": SimpleNamespace},
    }
    for name, names in parts.items():
        made = ModuleType(name)
        vars(made).update(names)
        monkeypatch.setitem(sys.modules, name, made)
