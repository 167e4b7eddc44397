"""A ROS 2 node: images in, poses along the route and diagnostics out.

It needs ROS 2 (rclpy, sensor_msgs, geometry_msgs, diagnostic_msgs), and surefix in the same Python.
This file has only the ROS interface; the messages are computed in route_pose.py, which is tested
without ROS.

Run it with:
    python3 localizer_node.py --ros-args -p map:=route.safetensors -r image:=/camera/image_raw
"""

import sys

from route_pose import RoutePose

import surefix

try:
    import rclpy
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
    from geometry_msgs.msg import PoseWithCovarianceStamped
    from rclpy.executors import ExternalShutdownException
    from rclpy.node import Node
    from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
    from sensor_msgs.msg import CompressedImage, Image
except ImportError as error:
    sys.exit(f"localizer_node: needs a ROS 2 installation, sourced in this shell ({error})")

# The camera's newest image only. A missed one is a gap, which the time stamps show.
NEWEST = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=1, reliability=ReliabilityPolicy.BEST_EFFORT
)


class LocalizerNode(Node):
    """Topics: image, ~/pose, /diagnostics.

    Parameters: map, frame_id, gap, sequence_length, compressed, publish_untrusted.
    """

    def __init__(self) -> None:
        super().__init__("surefix_localizer")
        path = self.declare_parameter("map", "route.safetensors").value
        gap = self.declare_parameter("gap", 1.0).value
        length = self.declare_parameter("sequence_length", 5).value
        self.frame_id = self.declare_parameter("frame_id", "map").value
        self.untrusted = self.declare_parameter("publish_untrusted", False).value
        kind = CompressedImage if self.declare_parameter("compressed", False).value else Image
        self.route = RoutePose(surefix.Map.open(path), gap=gap, sequence_length=length)
        self.poses = self.create_publisher(PoseWithCovarianceStamped, "~/pose", 10)
        self.diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_subscription(kind, "image", self.on_image, NEWEST)

    def on_image(self, message: "Image | CompressedImage") -> None:
        answer = self.route.push(message)
        if answer.pose is not None and (answer.trusted or self.untrusted):
            pose = PoseWithCovarianceStamped()
            pose.header.stamp, pose.header.frame_id = message.header.stamp, self.frame_id
            at, turned = pose.pose.pose.position, pose.pose.pose.orientation
            at.x, at.y, at.z = answer.pose.position
            turned.x, turned.y, turned.z, turned.w = answer.pose.quaternion
            pose.pose.covariance = answer.pose.covariance
            self.poses.publish(pose)
        status = DiagnosticStatus(
            level=bytes([answer.level]), name="surefix", message=answer.message
        )
        status.values = [KeyValue(key=key, value=value) for key, value in answer.values.items()]
        diagnostics = DiagnosticArray(status=[status])
        diagnostics.header.stamp = message.header.stamp
        self.diagnostics.publish(diagnostics)


def main() -> None:
    rclpy.init()
    try:
        rclpy.spin(LocalizerNode())
    except surefix.SurefixError as error:
        sys.exit(f"localizer_node: {error}")
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
