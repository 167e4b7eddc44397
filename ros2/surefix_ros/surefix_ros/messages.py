"""
The messages that the node publishes, of any ROS message classes.

``make(type, **fields)`` makes a message of a type such as std_msgs/msg/Header.
"""

from collections.abc import Callable, Sequence
import math
from typing import Any

from surefix.tables.route_poses import Pose, quaternion, RoutePoses
from surefix_ros.localization import Answer, Status

Make = Callable[..., Any]
# NavSatStatus and NavSatFix.
NO_FIX, FIX, APPROXIMATED = -1, 0, 1


def maker(*classes: type) -> Make:
    """Return what makes messages of these classes."""
    known = {f'{each.__module__.partition(".")[0]}/msg/{each.__name__}': each for each in classes}
    return lambda kind, **fields: known[kind](**fields)


def header(make: Make, stamp: Any, frame_id: str) -> Any:
    """Return a header."""
    return make('std_msgs/msg/Header', stamp=stamp, frame_id=frame_id)


def pose(make: Make, head: Any, found: Pose) -> Any:
    """Return a PoseWithCovarianceStamped."""
    with_covariance = make(
        'geometry_msgs/msg/PoseWithCovariance',
        pose=_pose(make, found.position, found.yaw),
        covariance=found.covariance,
    )
    kind = 'geometry_msgs/msg/PoseWithCovarianceStamped'
    return make(kind, header=head, pose=with_covariance)


def route(make: Make, head: Any, poses: RoutePoses) -> Any:
    """Return a PoseArray of the map's places."""
    places = zip(poses.positions.tolist(), poses.yaws.tolist(), strict=True)
    made = [_pose(make, position, yaw) for position, yaw in places]
    return make('geometry_msgs/msg/PoseArray', header=head, poses=made)


def nav_sat_fix(make: Make, head: Any, answer: Answer) -> Any | None:
    """Return a NavSatFix; None if the degrees of the place are not known."""
    where = answer.fix.position
    if answer.pose is None or where is None or where.degrees is None:
        return None
    covariance = answer.pose.covariance.reshape(6, 6)[:3, :3].ravel()
    status = FIX if answer.accepted else NO_FIX
    return make(
        'sensor_msgs/msg/NavSatFix',
        header=head,
        status=make('sensor_msgs/msg/NavSatStatus', status=status, service=0),
        latitude=where.degrees[0],
        longitude=where.degrees[1],
        # A height in the map is not known to be above the ellipsoid.
        altitude=math.nan,
        position_covariance=covariance,
        position_covariance_type=APPROXIMATED,
    )


def fix(make: Make, head: Any, answer: Answer) -> Any:
    """Return a surefix_msgs Fix."""
    found = answer.fix

    def known(value: float | None) -> float:
        return math.nan if value is None else value

    return make(
        'surefix_msgs/msg/Fix',
        header=head,
        frame=found.frame,
        place=found.place,
        place_name=answer.place_name,
        segment=found.segment,
        trusted=found.trusted,
        accepted=answer.accepted,
        score=found.score,
        confidence=known(found.confidence),
        off_map=known(found.off_map),
        speed=known(found.speed),
        single_place=found.single.place,
        single_distance=found.single.distance,
        advance=known(answer.advance),
        latency=answer.latency,
    )


def diagnostics(make: Make, head: Any, name: str, status: Status, level: Any) -> Any:
    """Return a DiagnosticArray; ``level`` is the status's, as ``make`` takes it."""
    values = [
        make('diagnostic_msgs/msg/KeyValue', key=key, value=value)
        for key, value in status.values.items()
    ]
    made = make(
        'diagnostic_msgs/msg/DiagnosticStatus',
        level=level,
        name=name,
        message=status.message,
        hardware_id='',
        values=values,
    )
    return make('diagnostic_msgs/msg/DiagnosticArray', header=head, status=[made])


def _pose(make: Make, position: Sequence[float], yaw: float) -> Any:
    x, y, z = position
    turn = dict(zip('xyzw', quaternion(yaw), strict=True))
    return make(
        'geometry_msgs/msg/Pose',
        position=make('geometry_msgs/msg/Point', x=x, y=y, z=z),
        orientation=make('geometry_msgs/msg/Quaternion', **turn),
    )
