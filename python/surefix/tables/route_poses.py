"""The pose at each place of a route: its position, its heading, and how far it may be wrong."""

import math

import numpy as np
import numpy.typing as npt

from surefix._core import Map, Segments
from surefix.errors import mismatch

Float64 = npt.NDArray[np.float64]

# The variance of a coordinate that is not measured, in square metres.
UNKNOWN = 1e6
# The variance of an unknown angle, uniform over the circle, in square radians.
ANY_ANGLE = (2 * math.pi) ** 2 / 12
# The standard deviation of the camera's heading from the route's, in radians.
HEADING = 0.2


class RoutePoses:
    """The pose at each place: x, y and z in metres (0 if the map has no heights), and the route's
    heading, ``yaw``, in radians from x to y.

    Raises
    ------
    SurefixValueError
        If the map has no positions.
    """

    def __init__(self, route: Map) -> None:
        where = route.positions
        if where is None:
            got = "none: build it with --positions or --odometry"
            raise mismatch("the map", "one with positions", got)
        self.flat = where.shape[1] == 2
        self.positions = np.pad(where, ((0, 0), (0, int(self.flat))))
        self.yaw = headings(where, route.segments)
        steps = np.linalg.norm(np.diff(where, axis=0), axis=1)
        self.spacing = float(np.median(steps[steps > 0])) if steps.any() else 0.0

    def quaternion(self, place: int) -> tuple[float, float, float, float]:
        """The heading as (x, y, z, w)."""
        half = self.yaw[place] / 2
        return 0.0, 0.0, math.sin(half), math.cos(half)

    def matrix(self, place: int) -> Float64:
        """The pose as KITTI has it: rotation and position, (3, 4)."""
        cos, sin = math.cos(self.yaw[place]), math.sin(self.yaw[place])
        turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
        return np.column_stack([turn, self.positions[place]])

    def covariance(self, place: int, belief: Float64) -> Float64:
        """How far the pose of a place may be wrong, (6, 6): x, y, z and the rotations about them,
        as in ``geometry_msgs/PoseWithCovariance``.

        It is the second moment of the belief in all places about this one, and that of a place
        itself, which stands for its surroundings. Roll, pitch and the height on a flat map are not
        measured, and have a large variance.
        """
        share = belief / max(float(belief.sum()), 1e-300)
        apart = self.positions - self.positions[place]
        about = np.full((6, 6), 0.0)
        about[:3, :3] = (apart * share[:, None]).T @ apart
        about[:3, :3] += np.eye(3) * self.spacing**2 / 12
        if self.flat:
            about[2, 2] = UNKNOWN
        about[3, 3] = about[4, 4] = ANY_ANGLE
        turned = np.remainder(self.yaw - self.yaw[place] + np.pi, 2 * np.pi) - np.pi
        about[5, 5] = min(float(share @ turned**2) + HEADING**2, ANY_ANGLE)
        return about


def headings(positions: Float64, segments: Segments) -> Float64:
    """The direction of the route at each place, in radians from x to y: from the place before to
    the one after, of the same segment. At places that share a position it is that of the last
    step; 0 in a segment of one position.
    """
    yaw = np.zeros(len(positions))
    for road in segments:
        at = positions[road.start : road.end, :2]
        if road.closed:
            at = np.concatenate([at[-1:], at, at[:1]])
        steps = np.diff(at, axis=0)
        moved = np.flatnonzero(steps.any(axis=1))
        if not len(moved):
            continue
        # A halt has the step before it, or the first one.
        last = np.maximum.accumulate(np.where(steps.any(axis=1), np.arange(len(steps)), -1))
        steps = steps[np.where(last < 0, moved[0], last)]
        steps = steps / np.linalg.norm(steps, axis=1, keepdims=True)
        around = steps[1:] + steps[:-1]
        if not road.closed:
            around = np.concatenate([steps[:1], around, steps[-1:]])
        yaw[road.start : road.end] = np.arctan2(around[:, 1], around[:, 0])
    return yaw
