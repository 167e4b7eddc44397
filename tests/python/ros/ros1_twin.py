"""A twin of the node in ROS 1, and a camera for it: ``ros1_twin.py node FILE``, ``camera FOLDER``.

ROS 1 is what Debian ships. It has the same topics, and all of the node's logic; its services,
parameters and qualities of service are others, and are left out.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

# Last, so that the libraries beside surefix come first.
sys.path.append("/usr/lib/python3/dist-packages")

import genpy
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
)
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image
from std_msgs.msg import Header

# As they are called in ROS 2.
genpy.Time.sec = property(lambda stamp: stamp.secs)
genpy.Time.nanosec = property(lambda stamp: stamp.nsecs)
MAKE_OF = (
    DiagnosticArray, DiagnosticStatus, Header, KeyValue, Point, Pose, PoseWithCovariance,
    PoseWithCovarianceStamped, Quaternion,
)  # fmt: skip


def node(file: str) -> None:
    """Localizes what comes."""
    from surefix_ros import messages
    from surefix_ros.localization import Localization

    localization = Localization({"map": file, "odometry_topic": "/odom"})
    make = messages.maker(*MAKE_OF)
    poses = rospy.Publisher("~pose", PoseWithCovarianceStamped, queue_size=100)
    told = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=100)

    def image(message: Any) -> None:
        answer = localization.image(message)
        head = messages.header(make, message.header.stamp, "map")
        status = localization.status()
        told.publish(messages.diagnostics(make, head, "surefix", status, status.level))
        if answer is not None:
            poses.publish(messages.pose(make, head, answer.pose))

    rospy.Subscriber("/odom", Odometry, localization.odometry, queue_size=1000)
    rospy.Subscriber("/image", Image, image, queue_size=100)
    rospy.spin()


def camera(folder: str) -> None:
    """Publishes a drive, and prints each pose and the last status as JSON."""
    drive = np.load(Path(folder) / "drive.npz")
    images = rospy.Publisher("/image", Image, queue_size=100)
    wheels = rospy.Publisher("/odom", Odometry, queue_size=1000)
    found: list[Any] = []
    status: list[Any] = []
    rospy.Subscriber("/surefix/pose", PoseWithCovarianceStamped, found.append)
    rospy.Subscriber("/diagnostics", DiagnosticArray, status.append)
    while not (images.get_num_connections() and wheels.get_num_connections()):
        rospy.sleep(0.01)
    stamps = [rospy.Time(*map(int, pair)) for pair in drive["stamps"]]
    for stamp, (x, y, yaw) in zip(stamps, drive["poses"].tolist(), strict=True):
        message = Odometry(header=Header(stamp=stamp, frame_id="odom"))
        message.pose.pose.position = Point(x, y, 0)
        message.pose.pose.orientation = Quaternion(0, 0, np.sin(yaw / 2), np.cos(yaw / 2))
        wheels.publish(message)
    rospy.sleep(1)
    for count, (stamp, pixels) in enumerate(zip(stamps, drive["images"], strict=True), 1):
        height, width = pixels.shape[:2]
        head, data = Header(stamp=stamp, frame_id="camera"), pixels.tobytes()
        image = Image(head, height, width, "rgb8", 0, 3 * width, data)
        images.publish(image)
        while len(found) < count or len(status) < count:
            rospy.sleep(0.002)
    for message in found:
        at, stamp = message.pose.pose.position, message.header.stamp
        line = {"stamp": [stamp.secs, stamp.nsecs], "position": [at.x, at.y, at.z]}
        print(json.dumps(line | {"covariance": message.pose.covariance}))
    last = status[-1].status[0]
    values = {each.key: each.value for each in last.values}
    print(json.dumps({"level": last.level, "message": last.message, "values": values}))


if __name__ == "__main__":
    what, given = sys.argv[1:]
    rospy.init_node("surefix" if what == "node" else "camera", disable_signals=False)
    {"node": node, "camera": camera}[what](given)
