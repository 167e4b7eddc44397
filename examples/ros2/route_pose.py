"""From an image message to a pose with a covariance, and a status. Needs no ROS.

The covariance expresses the trust flag in metres:

- trusted: within one place: the standard deviation is the distance between neighbouring places;
- untrusted: anywhere along the route: that of a uniform distribution over its length, length /
  sqrt(12).

Height on a flat map, roll and pitch cannot be measured and have a very large variance.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

import surefix
from surefix.frames import image_of

__all__ = ["Answer", "Pose", "RoutePose"]

# DiagnosticStatus.OK, WARN, ERROR
OK, WARN, ERROR = 0, 1, 2
# The variance of a coordinate that is not measured, in square metres.
UNKNOWN = 1e6
# The variance of an unknown angle: that of a uniform distribution over the circle, in square
# radians.
ANY_ANGLE = (2 * math.pi) ** 2 / 12
# The standard deviation of the camera's heading from the route's, in radians, at a known place.
HEADING = 0.2


@dataclass(frozen=True)
class Pose:
    """A place's position in metres, the route's heading there in radians, and the covariance: 6 x
    6, row by row.

    The rows are x, y, z and the rotations about them, as in ``geometry_msgs/PoseWithCovariance``.
    """

    position: tuple[float, float, float]
    yaw: float
    covariance: npt.NDArray[np.float64]

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """The heading as (x, y, z, w)."""
        return (0.0, 0.0, math.sin(self.yaw / 2), math.cos(self.yaw / 2))


@dataclass(frozen=True)
class Answer:
    """The answer to one image. ``fix`` and ``pose`` are None if the image is unusable."""

    fix: surefix.Fix | None
    pose: Pose | None
    trusted: bool
    level: int
    message: str
    values: dict[str, str]


class RoutePose:
    """Localizes image messages along a map that has positions.

    Parameters
    ----------
    route : Map
        With positions, in the metres of the frame that poses are published in.
    gap : float
        Images more than this many seconds apart, or out of order, are treated as a break.
    **options
        As for ``surefix.Localizer``.
    """

    def __init__(self, route: surefix.Map, gap: float = 1.0, **options: Any) -> None:
        if route.positions is None:
            raise surefix.SurefixValueError(
                "the map: expected one with positions, got none: surefix map build --positions"
            )
        self.localizer = surefix.Localizer(route, **options)
        self.gap = gap
        self.gaps = self.refused = 0
        self.before: float | None = None
        flat = route.positions.shape[1] == 2
        self.positions = np.pad(route.positions, ((0, 0), (0, int(flat))))
        steps = np.diff(self.positions, axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        self.spacing = max(float(np.median(lengths)), 0.1)
        self.anywhere = max(float(lengths.sum()) / math.sqrt(12), self.spacing)
        self.height_known = not flat
        # The heading at a place is the direction from the place before to the one after.
        around = np.concatenate([steps[:1], steps[1:] + steps[:-1], steps[-1:]])
        self.yaws = np.arctan2(around[:, 1], around[:, 0])

    def push(self, message: Any) -> Answer:
        """Takes a sensor_msgs Image or CompressedImage, in the order of their stamps.

        An unusable image raises no error: the answer has the reason, and a gap follows it.
        """
        time = message.header.stamp.sec + message.header.stamp.nanosec / 1e9
        if self.before is not None and not 0 <= time - self.before <= self.gap:
            self._break()
        self.before = time
        try:
            fix = self.localizer.push(image_of(message))
        except surefix.SurefixError as error:
            self.refused += 1
            self._break()
            return Answer(None, None, False, ERROR, str(error), self._values(None))
        # The flag is about the single match and the pose is the sequence's, so the two must agree.
        trusted = fix.trusted and abs(fix.place - fix.single.place) <= 1
        return Answer(
            fix,
            self._pose(fix.place, trusted),
            trusted,
            *self._word(fix, trusted),
            self._values(fix),
        )

    def _break(self) -> None:
        self.gaps += 1
        self.localizer.gap()

    def _pose(self, place: int, trusted: bool) -> Pose:
        along = (self.spacing if trusted else self.anywhere) ** 2
        height = along if self.height_known else UNKNOWN
        yaw = HEADING**2 if trusted else ANY_ANGLE
        x, y, z = self.positions[place].tolist()
        return Pose(
            (x, y, z),
            float(self.yaws[place]),
            np.diag([along, along, height, ANY_ANGLE, ANY_ANGLE, yaw]).ravel(),
        )

    def _word(self, fix: surefix.Fix, trusted: bool) -> tuple[int, str]:
        if fix.sequence is None:
            return WARN, "warming up"
        return (OK, "trusted") if trusted else (WARN, "not trusted")

    def _values(self, fix: surefix.Fix | None) -> dict[str, str]:
        values = {"gaps": str(self.gaps), "refused images": str(self.refused)}
        if fix is not None:
            anchors = "" if fix.sequence is None else str(fix.sequence.anchors)
            values |= {
                "frame": str(fix.frame),
                "place": str(fix.place),
                "score": f"{fix.score:.4f}",
                "anchors": anchors,
            }
        return values
