"""From a place to a pose with a covariance, by the positions in the map.

With a motion the covariance is that of the belief on the map: the second moment of the places'
positions about the given one, and the spread of the route's headings. If the robot is lost, its
standard deviation is at least the extent of the whole route. Without a motion, a fix is right
within a place, unless the robot is lost.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from surefix._core import Map, Segments
from surefix.errors import mismatch

Float64 = npt.NDArray[np.float64]

# The variance of a coordinate that is not measured, in square metres.
UNKNOWN = 1e6
# The variance of an angle that may be any, in square radians.
ANY_ANGLE = math.pi**2 / 3
# The standard deviation of the camera's heading from the route's, in radians, at a known place.
HEADING = 0.2


class Pose(NamedTuple):
    """A position in metres, a heading in radians, and the covariance: 6 x 6, row by row.

    Its rows are x, y, z and the rotations about them, as in geometry_msgs/PoseWithCovariance.
    """

    position: tuple[float, float, float]
    yaw: float
    covariance: Float64


class RoutePoses:
    """The poses along a map with positions, in metres; z is 0 if the map has no heights.

    ``backwards`` if the robot's forward axis points against the route.

    Raises
    ------
    SurefixValueError
        If the map has no positions.
    """

    def __init__(self, route: Map, backwards: bool = False) -> None:
        where = route.positions
        if where is None:
            got = "none: build it with --positions or --odometry"
            raise mismatch("the map", "one with positions", got)
        self.height_known = where.shape[1] == 3
        self.positions: Float64 = np.pad(where, ((0, 0), (0, 3 - where.shape[1])))
        self.yaws = headings(self.positions, route.segments) + math.pi * backwards
        self.ahead = np.stack([np.cos(self.yaws), np.sin(self.yaws)], axis=1)
        steps = np.linalg.norm(np.diff(self.positions, axis=0), axis=1)
        self.spacing = float(np.median(steps[steps > 0])) if steps.any() else 1.0
        extent = float(np.linalg.norm(np.ptp(self.positions, axis=0)))
        # The variance of a robot that may be anywhere.
        self.anywhere = max(extent, self.spacing) ** 2

    def pose(self, place: int, belief: Float64 | None, lost: bool) -> Pose:
        """The pose of a place; ``belief`` is the localizer's, in all places, if it has one."""
        moment = np.eye(3) * (self.anywhere if lost else 0.0)
        turned = ANY_ANGLE if lost else 0.0
        if belief is not None:
            on_map = belief / max(belief.sum(), 1e-300)
            away = self.positions - self.positions[place]
            moment = moment + (on_map[:, None] * away).T @ away
            mean = math.hypot(*(on_map @ self.ahead))
            # The variance of a wrapped normal distribution with this mean.
            turned += min(-2 * math.log(min(max(mean, 1e-9), 1.0)), ANY_ANGLE)
        # The robot is somewhere within the place.
        moment = moment + np.eye(3) * self.spacing**2 / 12
        if not self.height_known:
            moment[2, :] = moment[:, 2] = 0
            moment[2, 2] = UNKNOWN
        covariance = np.diag([0.0, 0.0, 0.0, ANY_ANGLE, ANY_ANGLE, turned + HEADING**2])
        covariance[:3, :3] = moment
        x, y, z = self.positions[place].tolist()
        return Pose((x, y, z), float(self.yaws[place]), covariance.ravel())

    def matrix(self, place: int) -> Float64:
        """The pose as KITTI has it: rotation and position, (3, 4)."""
        cos, sin = self.ahead[place]
        turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
        return np.column_stack([turn, self.positions[place]])


def quaternion(yaw: float) -> tuple[float, float, float, float]:
    """A heading as (x, y, z, w)."""
    return 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)


def headings(positions: Float64, segments: Segments) -> Float64:
    """The route's heading at each place in radians from x to y, shape (n,).

    It is the direction from the place before to the one after, in the same segment; if the robot
    stood still, that of the place before.
    """
    yaws = np.zeros(len(positions))
    for segment in segments:
        places = slice(segment.start, segment.end)
        own = positions[places, :2]
        if segment.closed:
            around = np.roll(own, -1, axis=0) - np.roll(own, 1, axis=0)
        else:
            around = np.gradient(own, axis=0) if len(own) > 1 else np.zeros_like(own)
        moving = np.linalg.norm(around, axis=1) > 0
        if moving.any():
            first = int(np.argmax(moving))
            last = np.maximum.accumulate(np.where(moving, np.arange(len(own)), first))
            yaws[places] = np.arctan2(around[:, 1], around[:, 0])[last]
    return yaws
