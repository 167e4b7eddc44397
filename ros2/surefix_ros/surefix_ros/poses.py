"""
From a fix to a pose with a covariance, by the positions in the map.

With a motion the covariance is that of the belief on the map: the second moment of the places'
positions about the published one, and the spread of the route's headings. If the robot is perhaps
off the map, its standard deviation is at least the extent of the whole route. Without a motion, an
accepted fix is right within a place, and another one may be anywhere along the route.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from surefix import Fix, Map, Segments
from surefix.motion import PERHAPS_OFF

# The variance of a coordinate that is not measured, in square metres.
UNKNOWN = 1e6
# The variance of an angle that may be any, in square radians.
ANY_ANGLE = math.pi**2 / 3
# The standard deviation of the camera's heading from the route's, in radians, at a known place.
HEADING = 0.2


class Pose(NamedTuple):
    """
    A position in metres, a heading in radians, and the covariance: 6 x 6, row by row.

    Its rows are x, y, z and the rotations about them, as in geometry_msgs/PoseWithCovariance.
    """

    position: tuple[float, float, float]
    yaw: float
    covariance: npt.NDArray[np.float64]


class RoutePoses:
    """
    The poses along a map with positions, in metres.

    ``backwards`` if the robot's forward axis points against the route.
    """

    def __init__(self, route: Map, backwards: bool = False) -> None:
        flat = route.positions.shape[1] == 2
        self.height_known = not flat
        self.positions = np.pad(route.positions, ((0, 0), (0, int(flat))))
        self.yaws = headings(self.positions, route.segments) + math.pi * backwards
        self.ahead = np.stack([np.cos(self.yaws), np.sin(self.yaws)], axis=1)
        steps = np.linalg.norm(np.diff(self.positions, axis=0), axis=1)
        self.spacing = float(np.median(steps[steps > 0])) if steps.any() else 1.0
        extent = float(np.linalg.norm(np.ptp(self.positions, axis=0)))
        # The variance of a robot that may be anywhere.
        self.anywhere = max(extent, self.spacing) ** 2

    def pose(self, fix: Fix, belief: npt.NDArray[np.float64] | None, accepted: bool) -> Pose:
        """Return the pose of a fix; ``belief`` is the localizer's after it."""
        place = fix.place
        lost = not accepted if belief is None else fix.off_map > PERHAPS_OFF
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


def headings(positions: npt.NDArray[np.float64], segments: Segments) -> npt.NDArray[np.float64]:
    """
    Return the route's heading at each place in radians, shape (n,).

    It is the direction from the place before to the one after, in the same segment; if the
    robot stood still, that of the place before.
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
