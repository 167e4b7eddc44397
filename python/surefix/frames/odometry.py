"""Positions of the robot at times, by its own account."""

import math
from collections.abc import Sequence
from contextlib import closing
from copy import copy
from functools import partial
from os import PathLike, fspath
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from surefix._words import plural
from surefix.errors import SurefixValueError, mismatch
from surefix.frames.bag import stamp_of
from surefix.frames.recording import Message, Place, Recording, open_recording
from surefix.frames.timeline import SECOND, timeline
from surefix.frames.trajectories import Trajectory, along_of, read_csv, read_trajectory
from surefix.tables.metres import centre, local_metres

Float64 = npt.NDArray[np.float64]

ODOMETRY, NAV_SAT_FIX = "nav_msgs/msg/Odometry", "sensor_msgs/msg/NavSatFix"
POSE, TRANSFORM = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/TransformStamped"
WITH_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
TOPICS = (ODOMETRY, POSE, WITH_COVARIANCE, TRANSFORM, NAV_SAT_FIX)


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
    along : array, shape (n,), optional
        The distance driven so far, which decreases if the robot reverses, if it is known. Positions
        (n, 1) are that themselves.

    Attributes
    ----------
    by_frame : bool
        Whether row k is of frame k, as in KITTI's files; ``timed``: whether it has a time too.
    degrees : array of float64, shape (n, 2), or None
        The latitude and longitude of a NavSatFix.
    origin : (float, float), or None
        The latitude and longitude that its metres are about (``surefix.datasets.local_metres``).
    remarks : list of str
        What was assumed or left out when it was read.

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
    >>> wheels.moved(1.0, 1.5)
    2.0
    >>> Odometry([0, 1, 2], [[0.0], [2.0], [1.5]]).moved(1, 2)
    -0.5
    """

    by_frame, timed = False, True

    def __init__(
        self,
        times: npt.ArrayLike,
        positions: npt.ArrayLike,
        source: str = "odometry",
        along: npt.ArrayLike | None = None,
    ) -> None:
        self.source = source
        self.remarks: list[str] = []
        self.degrees: Float64 | None = None
        self.origin: tuple[float, float] | None = None
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
        if along is None and self.positions.shape[1] == 1:
            along = self.positions[:, 0]
        self.along: Float64 | None = None if along is None else np.asarray(along, np.float64)
        if self.along is not None:
            if self.along.shape != self.times.shape:
                expected = f"along of the shape {self.times.shape}"
                raise mismatch(source, expected, self.along.shape)
            if not np.isfinite(self.along).all():
                row = int(np.argmin(np.isfinite(self.along)))
                raise mismatch(source, "finite metres along", f"{self.along[row]} in row {row}")

    def at(self, time: float) -> Float64 | None:
        """The position at a time, shape (d,); None before the first and after the last."""
        return self._at(time, self.positions)

    def moved(self, start: float, end: float) -> float | None:
        """The metres driven from one time to another, negative backwards; None if the position is
        unknown at one of them. Without ``along`` it is the straight distance, never negative.
        """
        along = None if self.along is None else self.along[:, None]
        values = self.positions if along is None else along
        before, after = self._at(start, values), self._at(end, values)
        if before is None or after is None:
            return None
        return math.dist(before, after) if along is None else float(after[0] - before[0])

    def about(self, origin: tuple[float, float]) -> Self:
        """The same with the metres of its degrees about another origin."""
        assert self.degrees is not None
        other = copy(self)
        latitude, longitude = self.degrees.T
        other.positions, other.origin = local_metres(latitude, longitude, origin), origin
        return other

    def numbered(self) -> Self:
        """The same with row numbers as times, for frames that have none: see ``by_frame``."""
        other = copy(self)
        other.times = np.arange(len(self.times), dtype=np.float64)
        other.timed = False
        return other

    def _at(self, time: float, values: Float64) -> Float64 | None:
        if not self.times[0] <= time <= self.times[-1]:
            return None
        after = int(np.searchsorted(self.times, time))
        if self.times[after] == time:
            return np.asarray(values[after])
        fraction = (time - self.times[after - 1]) / (self.times[after] - self.times[after - 1])
        return np.asarray(values[after - 1] + fraction * (values[after] - values[after - 1]))

    @classmethod
    def from_file(cls, path: str | PathLike[str]) -> Self:
        """From a file; its first lines tell which of these it is:

        - a table with a header, as for ``from_csv``;
        - TUM: ``timestamp tx ty tz qx qy qz qw``, in seconds and metres;
        - KITTI: the 12 numbers of a 3 x 4 pose; row k belongs to frame k. A ``times.txt`` beside
          it, or KITTI's own ``sequences/00/times.txt`` for ``poses/00.txt``, has the times;
        - EuRoC: ``#timestamp [ns],p_RS_R_x [m],...,q_RS_w [],...``, in nanoseconds and metres.

        Orientations tell driving from reversing if the robot drives along one of its axes: x of a
        robot, z of a camera. One that is the same all the time, or does not fit the way, is left
        out.

        Raises
        ------
        SurefixFileError
            If the file cannot be read.
        SurefixValueError
            If it is none of these: the error names the row.
        """
        return cls._of(read_trajectory(Path(path)), fspath(path))

    @classmethod
    def _of(cls, found: Trajectory, source: str) -> Self:
        times = np.arange(len(found.positions)) if found.times is None else found.times
        made = cls(times, found.positions, source, found.along)
        made.by_frame, made.timed = found.by_frame, found.times is not None
        made.remarks = [f"{source}: {text}" for text in found.remarks]
        return made

    @classmethod
    def from_csv(cls, path: str | PathLike[str]) -> Self:
        """From a table with a header: ``time`` in seconds, and ``x,y``, ``x,y,z`` or ``distance``
        in metres.

        A time in another unit is taken if its name says so (``time_ms``, ``timestamp [ns]``), or if
        as seconds since 1970 it would be thousands of years; ``remarks`` says it.

        A ``distance`` beside ``x,y`` is what was driven so far: it decreases if the robot reverses.
        So does a ``yaw`` tell it, the heading in radians from x to y. Other columns are passed
        over.

        Raises
        ------
        SurefixFileError
            If the file cannot be read.
        SurefixValueError
            If it lacks a column, or as ``Odometry`` does: the error names the row.
        """
        return cls._of(read_csv(Path(path)), fspath(path))

    @classmethod
    def from_bag(
        cls, path: Place | Sequence[Place], topic: str | None = None, *, recorded: bool = False
    ) -> Self:
        """From a topic of nav_msgs Odometry; of geometry_msgs PoseStamped,
        PoseWithCovarianceStamped or TransformStamped; or of NavSatFix. It may be left out if there
        is only one.

        Times are those of the messages' stamps, as with ``BagFrames``; those of the recording if a
        stamp is 0, or if the frames have them (``recorded``). Latitude and longitude of a NavSatFix
        become metres about their median (``origin``). Messages without a fix, with NaN, damaged
        ones, and those no later than the one before are left out, and counted in ``remarks``.
        Orientations tell driving from reversing as in ``from_file``; without them, the sign of
        ``twist.linear.x`` of an Odometry does.

        Raises
        ------
        SurefixError
            As ``BagFrames`` does; a SurefixValueError if there is no such topic: it lists those
            there are.
        """
        with open_recording(path, skip_bad=True) as bag:
            topic, kind = _topic(bag, topic)
            with closing(bag.messages(topic)) as found:
                read = list(map(partial(_known, kind), found))
            source, files, remarks = f"{bag.name}, {topic}", bag.files, [*bag.remarks]
        stamps, received, file = (
            np.array([each[column] for each in read], np.int64) for column in range(3)
        )
        whole = np.array([each.pose is not None for each in read], bool)
        if not whole.any():
            problems = [each.problem for each in read if each.problem]
            raise (
                SurefixValueError(problems[0])
                if problems
                else mismatch(source, "positions", "none")
            )
        line = timeline(received * 0 if recorded else stamps, received, file, whole, files)
        kept: list[int] = []
        for number in line.order:
            if not kept or line.time[number] > line.time[kept[-1]]:
                kept.append(number)
        remarks += [] if recorded else line.remarks
        if problems := [each.problem for each in read if each.problem]:
            remarks.append(f"{plural(len(problems), 'message')} left out; the first: {problems[0]}")
        if before := len(line.order) - len(kept):
            remarks.append(f"{plural(before, 'message')} left out, after the clock went back")
        # Of Python's integers, which are exact.
        times = np.array([int(line.time[each]) / SECOND for each in kept])
        values = np.array([read[each].pose for each in kept])
        made = cls._of_poses(kind, times, values, source)
        made.remarks = [f"{source}: {text}" for text in remarks]
        return made

    @classmethod
    def _of_poses(cls, kind: str, times: Float64, values: Float64, source: str) -> Self:
        if kind == NAV_SAT_FIX:
            latitude, longitude = values.T
            origin = centre(latitude, longitude)
            made = cls(times, local_metres(latitude, longitude, origin), source)
            made.degrees, made.origin = values, origin
            return made
        positions = values[:, :3]
        # Some nodes leave NaN or zeros in the fields that they do not know.
        known = np.nan_to_num(values[:, 3:])
        along, _ = along_of(positions, known[:, :4])
        ahead = np.sign(known[1:, 4] + known[:-1, 4])
        if along is None and ahead.any():
            steps = ahead * np.linalg.norm(np.diff(positions, axis=0), axis=1)
            along = np.concatenate([[0.0], np.cumsum(steps)])
        return cls(times, positions, source, along)


class _Known(NamedTuple):
    """A message: its stamp (0 if it has none), the time of its recording, its file; and its pose,
    None without a fix, or for a problem.
    """

    stamp: int
    recorded: int
    file: int
    pose: tuple[float, ...] | None
    problem: str = ""


def _known(kind: str, message: Message) -> _Known:
    if message.damage:
        problem = f"{message.where}: {message.damage}"
        return _Known(0, message.recorded, message.file, None, problem)
    at = stamp_of(message.content) or 0, message.recorded, message.file
    pose = _pose(kind, message.content)
    if pose is not None and not np.isfinite(pose[:3]).all():
        problem = str(mismatch(message.where, "finite numbers", pose[:3]))
        return _Known(*at, None, problem)
    return _Known(*at, pose)


def _topic(bag: Recording, topic: str | None) -> tuple[str, str]:
    """The topic of poses, the only one if none is named, and its type."""
    fitting = [name for name in sorted(bag.topics) if bag.topics[name].kind in TOPICS]
    if topic is None and len(fitting) == 1:
        topic = fitting[0]
    kind = bag.topics[topic].kind if topic in bag.topics else None
    if topic is None or kind not in TOPICS:
        names = fitting or sorted(bag.topics)
        listed = ", ".join(f"{name} ({bag.topics[name].kind})" for name in names)
        named = "no topic named" if topic is None else f"{topic!r} ({kind or 'not there'})"
        got = f"{named}; there are {listed or 'no topics'}"
        raise mismatch(bag.name, f"a topic of poses ({', '.join(TOPICS)})", got)
    return topic, str(kind)


def _pose(kind: str, message: Any) -> tuple[float, ...] | None:
    """Degrees of latitude and longitude, None if a receiver has no fix; or a position in metres,
    a quaternion (x, y, z, w), and the speed ahead, 0 if it is unknown.
    """
    if kind == NAV_SAT_FIX:
        return None if message.status.status < 0 else (message.latitude, message.longitude)
    if kind == TRANSFORM:
        at, q = message.transform.translation, message.transform.rotation
    else:
        pose = message.pose if kind == POSE else message.pose.pose
        at, q = pose.position, pose.orientation
    speed = message.twist.twist.linear.x if kind == ODOMETRY else 0.0
    return (at.x, at.y, at.z, q.x, q.y, q.z, q.w, speed)
