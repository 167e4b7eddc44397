"""How far the robot has driven, by nav_msgs/Odometry messages as they come."""

from collections import deque
from itertools import islice
import math
from typing import Any, NamedTuple

import numpy as np
from surefix.frames.bag import stamp_of
from surefix.tables.poses import rotations


class Mark(NamedTuple):
    """Metres driven so far, less those backwards, since the odometry's start number ``start``."""

    start: int
    metres: float


class Travel:
    """
    The way driven along the robot's own x axis (REP 105), linear between messages.

    If the clock goes back, or the pose leaps as an odometry that starts anew does, the way begins
    anew: marks of different starts cannot be compared.
    """

    # Seconds that are kept; seconds after the newest message for which its speed is believed.
    KEPT, AHEAD = 30.0, 0.5
    # In metres a second; what is faster is a leap.
    FASTEST = 100.0

    def __init__(self) -> None:
        self.starts = self.refused = 0
        self._way: deque[tuple[float, float]] = deque()
        self._pose: tuple[np.ndarray, np.ndarray] | None = None

    def add(self, message: Any) -> None:
        """Take a message; one with NaN is counted in ``refused``."""
        time = (stamp_of(message) or 0) / 1e9
        at, turn = message.pose.pose.position, message.pose.pose.orientation
        speed = message.twist.twist.linear.x
        position = np.array([at.x, at.y, at.z])
        quaternion = np.array([turn.x, turn.y, turn.z, turn.w])
        if not (np.isfinite(position).all() and np.isfinite(quaternion).all()):
            self.refused += 1
            return
        length = np.linalg.norm(quaternion)
        forward = rotations([quaternion / length])[0][:, 0] if length else np.zeros(3)
        if self._way and self._pose is not None:
            before, metres = self._way[-1]
            step = position - self._pose[0]
            length = float(np.linalg.norm(step))
            if time == before:
                return
            if time > before and length <= self.FASTEST * (time - before) + 1:
                # Without an orientation, the speed tells reversing.
                ahead = float(step @ (forward + self._pose[1])) or speed
                self._way.append((time, metres + math.copysign(length, ahead or 1.0)))
            else:
                self._way.clear()
                self.starts += 1
        if not self._way:
            self._way.append((time, 0.0))
        self._pose = position, forward
        while self._way[0][0] < time - self.KEPT:
            self._way.popleft()

    def at(self, time: float) -> Mark | None:
        """Return the way at a time in seconds; None if it is not known."""
        if not self._way or not self._way[0][0] <= time <= self._way[-1][0] + self.AHEAD:
            return None
        if len(self._way) == 1:
            return Mark(self.starts, self._way[0][1])
        newer = self._way[-1]
        for older in islice(reversed(self._way), 1, None):
            if older[0] <= time:
                break
            newer = older
        share = (time - older[0]) / (newer[0] - older[0])
        return Mark(self.starts, older[1] + share * (newer[1] - older[1]))
