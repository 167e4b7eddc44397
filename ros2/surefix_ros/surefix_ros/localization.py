"""From image and odometry messages to fixes, poses and a status. It needs no ROS."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from threading import Lock
import time as clock
from typing import Any, NamedTuple

import numpy as np
from surefix import Fix, SurefixError
from surefix.errors import mismatch
from surefix.frames import image_of
from surefix.frames.bag import stamp_of
from surefix.motion import PERHAPS_OFF
from surefix.tables.route_poses import Pose, RoutePoses
from surefix_ros.parameters import checked, localizer_of, settings_of
from surefix_ros.travel import Mark, Travel

# The levels of diagnostic_msgs/DiagnosticStatus.
OK, WARN, ERROR = 0, 1, 2


@dataclass(frozen=True)
class Answer:
    """The answer to an image; ``pose`` is None on a map without positions."""

    fix: Fix
    pose: Pose | None
    accepted: bool
    place_name: str
    # Whether the promise of the threshold holds no longer; False without one.
    alarm: bool
    # Places by odometry, None if unknown; and seconds.
    advance: float | None
    latency: float


class Status(NamedTuple):
    """A diagnostic status."""

    level: int
    message: str
    values: dict[str, str]


class Localization:
    """
    Localizes messages of a camera along a map; any thread may call it.

    A SurefixError says which of the parameters is wrong.
    """

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        self.parameters = found = checked(parameters)
        self.localizer = localizer_of(found)
        self.map = route = self.localizer.map
        self.names = route.names
        self.judged = self.localizer.threshold is not None
        self.scale = found['places_per_metre'] or route.places_per_metre
        self.by_odometry = bool(found['odometry_topic'])
        if self.by_odometry:
            moving = settings_of(found).options['motion'] is not None
            if moving and not self.scale:
                expected = 'a number other than 0, as the map has no positions'
                raise mismatch('parameter places_per_metre', expected, 0)
            if not moving and not found['metres']:
                raise mismatch('parameter odometry_topic', 'a motion other than none', 'none')
        backwards = found['places_per_metre'] < 0
        self.poses = None if route.positions is None else RoutePoses(route, backwards)
        self.travel = Travel()
        self.answer: Answer | None = None
        # Why the newest image could not be used; empty if it could.
        self.problem = ''
        self.images = self.refused = self.dropped = self.gaps = 0
        self._latencies: deque[float] = deque(maxlen=1000)
        # The time of the newest image that could be used; whether the drive is broken after it.
        self._seen: float | None = None
        self._broken = False
        # Of the newest image that was localized: its time, and the way driven until then.
        self._before: tuple[float, Mark | None] | None = None
        # Odometry does not wait for an image.
        self._lock, self._travelling = Lock(), Lock()
        self._came = clock.monotonic()

    def odometry(self, message: Any) -> None:
        """Take a nav_msgs/Odometry."""
        with self._travelling:
            self.travel.add(message)

    def image(self, message: Any, received: float = 0.0) -> Answer | None:
        """
        Take a sensor_msgs Image or CompressedImage; ``received`` is its time if it has no stamp.

        None if it is passed over by ``every`` or ``metres``, or cannot be used: ``problem`` says
        why, and the next one is localized as if it had not come.
        """
        began = clock.perf_counter()
        stamp = stamp_of(message)
        time = stamp / 1e9 if stamp else received
        with self._lock:
            self._came = clock.monotonic()
            self.problem = ''
            with self._travelling:
                mark = self.travel.at(time)
            if self._seen is not None and not 0 <= time - self._seen <= self.parameters['gap']:
                self._broken = True
            if self._is_near(time, mark):
                self._seen = time
                return None
            self.images += 1
            advance = self._advance(mark)
            try:
                image = image_of(message)
                if self._broken:
                    self.localizer.gap(None if advance is None else 0.0)
                fix = self.localizer.push(image, advance=advance)
            except SurefixError as error:
                self.problem = str(error)
                self.refused += 1
                return None
            self.gaps += self._broken
            self._seen, self._broken, self._before = time, False, (time, mark)
            accepted = self._is_accepted(fix)
            pose = None
            if self.poses is not None:
                belief = self.localizer.belief
                lost = not accepted if belief is None else fix.off_map > PERHAPS_OFF
                pose = self.poses.pose(fix.place, belief, lost)
            name = self.names[fix.place] if self.names else ''
            latency = clock.perf_counter() - began
            self._latencies.append(latency)
            alarm = self.localizer.alarm
            self.answer = Answer(fix, pose, accepted, name, alarm, advance, latency)
            return self.answer

    def gap(self) -> None:
        """Say that the next image does not follow on the one before."""
        with self._lock:
            if self._before is not None:
                self._broken, self._before = True, (self._before[0], None)

    def reset(self) -> None:
        """Forget all images."""
        with self._lock:
            self.localizer.reset()
            self.answer = self._before = self._seen = None
            self._broken, self.problem = False, ''

    def status(self) -> Status:
        """Return how it goes, with the latencies since the status before."""
        with self._lock:
            answer, latencies = self.answer, np.array(self._latencies) * 1000
            self._latencies.clear()
            silent = clock.monotonic() - self._came
        values = {
            'images': self.images,
            'refused images': self.refused,
            'dropped images': self.dropped,
            'gaps': self.gaps,
        }
        if self.by_odometry:
            values['refused odometry'] = self.travel.refused
        if len(latencies):
            values['latency, median (ms)'] = f'{np.median(latencies):.1f}'
            values['latency, most (ms)'] = f'{latencies.max():.1f}'
        if answer is not None:
            fix = answer.fix
            values |= {'place': fix.place, 'trusted': fix.trusted, 'accepted': answer.accepted}
            if fix.track is not None:
                values['confidence'] = f'{fix.track.confidence:.3f}'
                values['off the map'] = f'{fix.track.off_map:.3f}'
            if self.judged:
                values['alarm'] = answer.alarm
        texts = {key: str(value) for key, value in values.items()}
        return Status(*self._word(answer, silent), texts)

    def _word(self, answer: Answer | None, silent: float) -> tuple[int, str]:
        if silent > max(5.0, self.parameters['gap']):
            return ERROR, f'no image for {silent:.0f} s'
        if self.problem:
            return ERROR, self.problem
        if answer is None:
            return WARN, 'no image yet'
        if answer.alarm:
            return WARN, 'the scores are not those of the calibration: its promise does not hold'
        if self.by_odometry and answer.advance is None and answer.fix.frame:
            return WARN, 'no odometry at the time of the image'
        if answer.fix.off_map is not None and answer.fix.off_map > PERHAPS_OFF:
            return WARN, 'perhaps off the map'
        return (OK, 'accepted') if answer.accepted else (WARN, 'not sure enough')

    def _is_near(self, time: float, mark: Mark | None) -> bool:
        """Whether an image is passed over, as it is too near to the one before."""
        if self._before is None or self._broken:
            return False
        past, before = self._before
        if self.parameters['metres'] and mark and before and mark.start == before.start:
            return abs(mark.metres - before.metres) < self.parameters['metres']
        # A camera's clock is not exact to a millisecond.
        return time - past < self.parameters['every'] - 0.001

    def _advance(self, mark: Mark | None) -> float | None:
        """Return the places passed since the image before; None if they are not known."""
        before = None if self._before is None else self._before[1]
        if mark is None or before is None or mark.start != before.start or not self.scale:
            return None
        return self.scale * (mark.metres - before.metres)

    def _is_accepted(self, fix: Fix) -> bool:
        if self.judged:
            return bool(fix.accepted)
        if fix.confidence is not None:
            return fix.confidence >= self.parameters['accept']
        # The flag is of the single match, and the place is the sequence's: both must agree.
        place, single = np.array([fix.place]), np.array([fix.single.place])
        near = self.map.segments.are_near(place, single, self.parameters['tolerance'])
        return fix.trusted and bool(near[0])
