"""Positions of the robot at times, by its own account."""

from os import PathLike, fspath
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from surefix.errors import mismatch
from surefix.frames.bag import messages, open_bag
from surefix.tables.metres import local_metres
from surefix.tables.rows import columns

Float64 = npt.NDArray[np.float64]

COLUMNS = "time in seconds, and x,y[,z] or distance in metres"
CHOICES = (("time", "x", "y", "z"), ("time", "x", "y"), ("time", "distance"))
POSE, NAV_SAT_FIX = "geometry_msgs/msg/PoseStamped", "sensor_msgs/msg/NavSatFix"
TOPICS = ("nav_msgs/msg/Odometry", POSE, "geometry_msgs/msg/PoseWithCovarianceStamped", NAV_SAT_FIX)


class Odometry:
    """Positions in metres at times in seconds, linear between.

    Parameters
    ----------
    times : array, shape (n,)
        Seconds, ascending; of the same clock as those of the frames.
    positions : array, shape (n, d)
        Metres: (x, y) or (x, y, z); or (n, 1), the distance driven so far.
    source : str
        Its name in an error.

    Raises
    ------
    SurefixValueError
        For no rows, another shape, numbers that are not finite, or times that do not ascend: the
        error names the row.

    Examples
    --------
    >>> from surefix.frames import Odometry
    >>> wheels = Odometry([0, 1, 2], [[0.0, 0.0], [2.0, 0.0], [2.0, 4.0]])
    >>> wheels.at(1.5).tolist()
    [2.0, 2.0]
    >>> wheels.at(9.0) is None
    True
    """

    def __init__(
        self, times: npt.ArrayLike, positions: npt.ArrayLike, source: str = "odometry"
    ) -> None:
        self.source = source
        self.times: Float64 = np.asarray(times, np.float64)
        self.positions: Float64 = np.asarray(positions, np.float64)
        shapes = self.times.ndim, self.positions.ndim
        if shapes != (1, 2) or self.positions.shape[1] not in (1, 2, 3):
            got = f"{self.times.shape} and {self.positions.shape}"
            raise mismatch(source, "times (n,) and positions (n, 1), (n, 2) or (n, 3)", got)
        if len(self.times) != len(self.positions) or not len(self.times):
            got = f"{len(self.times)} times and {len(self.positions)} positions"
            raise mismatch(source, "a position for each time, one or more", got)
        whole = np.isfinite(self.times) & np.isfinite(self.positions).all(axis=1)
        if not whole.all():
            row = int(np.argmin(whole))
            got = f"{self.times[row]}, {self.positions[row].tolist()}"
            raise mismatch(source, "finite numbers", f"{got} in row {row}")
        late = np.flatnonzero(np.diff(self.times) <= 0)
        if len(late):
            row = int(late[0]) + 1
            got = f"{self.times[row]} after {self.times[row - 1]}"
            raise mismatch(source, "ascending times", f"{got} in row {row}")

    def at(self, time: float) -> Float64 | None:
        """The position at a time, shape (d,); None before the first and after the last."""
        if not self.times[0] <= time <= self.times[-1]:
            return None
        after = int(np.searchsorted(self.times, time))
        if self.times[after] == time:
            return np.asarray(self.positions[after])
        fraction = (time - self.times[after - 1]) / (self.times[after] - self.times[after - 1])
        before, step = self.positions[after - 1], self.positions[after] - self.positions[after - 1]
        return np.asarray(before + fraction * step)

    @classmethod
    def from_csv(cls, path: str | PathLike[str]) -> Self:
        """From a table with a header: ``time`` in seconds, and ``x,y``, ``x,y,z`` or ``distance``
        in metres.

        Other columns are passed over.

        Raises
        ------
        SurefixFileError
            If the file cannot be read.
        SurefixValueError
            If it lacks a column, or as ``Odometry`` does: the error names the row.
        """
        file = Path(path)
        _, values, rows, _ = columns(file, CHOICES, COLUMNS)
        late = np.flatnonzero(np.diff(values[:, 0]) <= 0)
        if len(late):
            row = int(late[0]) + 1
            got = f"{values[row, 0]} after {values[row - 1, 0]}"
            raise mismatch(f"{file}, row {rows[row]}", "ascending times", got)
        return cls(values[:, 0], values[:, 1:], str(file))

    @classmethod
    def from_bag(cls, path: str | PathLike[str], topic: str) -> Self:
        """From a topic of nav_msgs Odometry, geometry_msgs PoseStamped or
        PoseWithCovarianceStamped, or NavSatFix.

        Times are those of the messages' stamps, as with ``BagFrames``. Latitude and longitude of a
        NavSatFix become metres about their mean; those without a fix are left out, as are messages
        no later than the one before.

        Raises
        ------
        SurefixError
            As ``BagFrames`` does; a SurefixValueError if there is no such topic: it lists those
            there are.
        """
        place = fspath(path)
        with open_bag(place) as bag:
            kinds = {name: info.msgtype for name, info in bag.topics.items()}
            kind = kinds.get(topic)
            if kind not in TOPICS:
                fitting = [name for name in kinds if kinds[name] in TOPICS]
                listed = ", ".join(f"{name} ({kinds[name]})" for name in sorted(fitting or kinds))
                got = f"{topic!r} ({kind or 'not there'}); there are {listed or 'no topics'}"
                raise mismatch(place, f"a topic of poses ({', '.join(TOPICS)})", got)
            times: list[float] = []
            positions: list[tuple[float, ...]] = []
            for time, message, where in messages(bag, place, topic):
                position = _position(kind, message)
                if position is None or (times and time <= times[-1]):
                    continue
                if not np.isfinite(position).all():
                    raise mismatch(where, "finite numbers", position)
                times.append(time)
                positions.append(position)
        source = f"{place}, {topic}"
        if not times:
            raise mismatch(source, "positions", "none")
        if kind == NAV_SAT_FIX:
            return cls(times, local_metres(*np.array(positions).T), source)
        return cls(times, np.array(positions), source)


def _position(kind: str, message: Any) -> tuple[float, ...] | None:
    """Metres, or degrees of latitude and longitude; None if a receiver has no fix."""
    if kind == NAV_SAT_FIX:
        return None if message.status.status < 0 else (message.latitude, message.longitude)
    pose = message.pose if kind == POSE else message.pose.pose
    return (pose.position.x, pose.position.y, pose.position.z)
