"""
The ROS interface of surefix: images and odometry in, fixes, poses and diagnostics out.

All of the work is done in localization.py, which needs no ROS.
"""

from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from queue import Empty, Queue
import sys

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseArray,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
)
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import ParameterDescriptor
import rclpy
from rclpy.exceptions import NameValidationException
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CompressedImage, Image, NavSatFix, NavSatStatus
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from surefix import SurefixError
from surefix_msgs.msg import Fix
from surefix_ros import messages
from surefix_ros.localization import Localization
from surefix_ros.parameters import PARAMETERS

MAKE = messages.maker(
    DiagnosticArray, DiagnosticStatus, Fix, Header, KeyValue, NavSatFix, NavSatStatus, Point,
    Pose, PoseArray, PoseWithCovariance, PoseWithCovarianceStamped, Quaternion,
)  # fmt: skip
# Seconds between two diagnostics.
PERIOD = 1.0


class LocalizerNode(Node):
    """
    Topics: the image and the odometry; ~/fix, ~/pose, ~/navsat, ~/route, /diagnostics.

    Services: ~/gap, ~/reset. ``error`` is one that ended it.
    """

    def __init__(self) -> None:
        super().__init__('surefix')
        values = {}
        for each in PARAMETERS:
            # Of any type, so that a wrong one is refused in the node's own words.
            described = ParameterDescriptor(
                description=each.about,
                additional_constraints=each.limits,
                read_only=True,
                dynamic_typing=True,
            )
            values[each.name] = self.declare_parameter(each.name, each.default, described).value
        self.localization = Localization(values)
        self.values = values = self.localization.parameters
        self.error: BaseException | None = None
        self.fixes = self.create_publisher(Fix, '~/fix', 10)
        if self.localization.poses is not None:
            self.poses = self.create_publisher(PoseWithCovarianceStamped, '~/pose', 10)
            self.navsat = self.create_publisher(NavSatFix, '~/navsat', 10)
            # For those that come later, too.
            latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            self.route = self.create_publisher(PoseArray, '~/route', latched)
            head = messages.header(MAKE, self.get_clock().now().to_msg(), values['frame_id'])
            self.route.publish(messages.route(MAKE, head, self.localization.poses))
        self.diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self.create_timer(PERIOD, self.tell)
        self.create_service(Trigger, '~/gap', self.gap)
        self.create_service(Trigger, '~/reset', self.reset)
        if values['odometry_topic']:
            many = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
            topic = values['odometry_topic']
            self.create_subscription(Odometry, topic, self.localization.odometry, many)
        kind, topic = Image, values['image_topic']
        if values['image_transport'] == 'compressed':
            kind, topic = CompressedImage, topic.removesuffix('/compressed') + '/compressed'
        quality = QoSProfile(
            history=HistoryPolicy.KEEP_LAST,
            depth=1,
            reliability=ReliabilityPolicy[values['image_reliability'].upper()],
        )
        self.create_subscription(kind, topic, self.take, quality)
        # The newest image; None at the end.
        self.waiting: Queue = Queue(1)
        self.worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix='surefix')
        self.worker.submit(self.work).add_done_callback(self.ended)

    def take(self, message: 'Image | CompressedImage | None') -> None:
        """Leave an image for the worker, in place of one that waits."""
        with suppress(Empty):
            self.waiting.get_nowait()
            self.localization.dropped += 1
        self.waiting.put(message)

    def work(self) -> None:
        """Localize the newest image, until the end."""
        while (message := self.waiting.get()) is not None:
            self.localize(message)

    def ended(self, work: Future) -> None:
        # An error after ROS was shut down is one of publishing to it.
        if work.exception() is not None and rclpy.ok():
            self.error = work.exception()
            rclpy.try_shutdown()

    def localize(self, message: 'Image | CompressedImage') -> None:
        now = self.get_clock().now()
        answer = self.localization.image(message, now.nanoseconds / 1e9)
        if answer is None:
            if self.localization.problem:
                self.get_logger().warning(self.localization.problem, throttle_duration_sec=5.0)
            return
        stamp = message.header.stamp
        if not (stamp.sec or stamp.nanosec):
            stamp = now.to_msg()
        head = messages.header(MAKE, stamp, self.values['frame_id'])
        self.fixes.publish(messages.fix(MAKE, head, answer))
        if answer.pose is None or (self.values['accepted_only'] and not answer.accepted):
            return
        self.poses.publish(messages.pose(MAKE, head, answer.pose))
        degrees = messages.nav_sat_fix(MAKE, head, answer)
        if degrees is not None:
            self.navsat.publish(degrees)

    def tell(self) -> None:
        """Publish the status."""
        status = self.localization.status()
        head = messages.header(MAKE, self.get_clock().now().to_msg(), '')
        name, level = f'{self.get_name()}: localization', bytes([status.level])
        self.diagnostics.publish(messages.diagnostics(MAKE, head, name, status, level))

    def gap(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.localization.gap()
        response.success, response.message = True, 'the next image begins a new stretch'
        return response

    def reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.localization.reset()
        response.success, response.message = True, 'all images are forgotten'
        return response

    def destroy_node(self) -> None:
        """End the worker, then the node."""
        self.take(None)
        self.worker.shutdown()
        super().destroy_node()


def main() -> None:
    """Run the node until it is shut down; a wrong parameter is one line and exit code 1."""
    rclpy.init()
    try:
        node = LocalizerNode()
    except (SurefixError, NameValidationException) as error:
        rclpy.try_shutdown()
        sys.exit(f'surefix: {" ".join(str(error).split())}')
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    if node.error is not None:
        raise node.error


if __name__ == '__main__':
    main()
