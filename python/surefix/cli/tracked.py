"""The track of a drive in sum: how sure it was, and whether trusted matches moved as it did."""

from array import array
from collections import deque

import numpy as np

from surefix import Fix
from surefix.motion import PERHAPS_OFF

__all__ = ["Agreement", "Tracked"]


class Agreement:
    """Pairs of trusted matches a few frames apart: how far they are apart on the map, beside how
    far the track moved.

    A pair disagrees if the two differ by more than the tolerance and a third of a place a frame.
    Wrongly trusted matches lie backwards as often as forwards: each disagreeing pair that goes back
    is taken for one of them, and cancels one that goes forwards. Pairs too far apart for any motion
    are not counted.

    Parameters
    ----------
    tolerance : int
        In places.
    """

    # In frames: a shorter pair is too short to tell half the map's rate from the whole.
    SHORTEST, LONGEST = 8, 20
    # In places a frame: a little more than ``motion="any"`` can follow.
    FASTEST = 6

    def __init__(self, tolerance: int = 1) -> None:
        self.tolerance = tolerance
        self.moved = 0.0
        self.trusted: deque[tuple[int, int, float]] = deque()
        self.agreed = self.forwards = self.backwards = 0

    def add(self, fix: Fix, lost: bool = False) -> None:
        """Takes a fix with a track; ``lost`` if nothing is known of the way before it."""
        assert fix.track is not None
        self.moved += fix.track.speed
        if lost:
            self.trusted.clear()
        while self.trusted and fix.frame - self.trusted[0][0] > self.LONGEST:
            self.trusted.popleft()
        if not fix.trusted:
            return
        place = fix.single.place
        apart = (each for each in reversed(self.trusted) if fix.frame - each[0] >= self.SHORTEST)
        if before := next(apart, None):
            frames, places = fix.frame - before[0], place - before[1]
            off = abs(places - (self.moved - before[2]))
            if off <= self.tolerance + frames / 3:
                self.agreed += 1
            elif abs(places) <= self.FASTEST * frames:
                self.forwards += places >= -self.tolerance
                self.backwards += places < -self.tolerance
        self.trusted.append((fix.frame, place, self.moved))

    def disagreeing(self) -> tuple[int, int] | None:
        """The pairs that disagree, and all; None if they are too few to tell, or no more than 60 %.

        Of 47 real drives made 1/3 to 5 times as fast (``surefix.study``) that have ten pairs, it
        finds 46 if the motion is "steady", and 2 if it is "any"; of 12 as they were, none.
        """
        off = max(0, self.forwards - self.backwards)
        count = self.agreed + off
        return (off, count) if count >= 10 and off > 0.6 * count else None


class Tracked:
    """Counts the fixes of a track as they come.

    Parameters
    ----------
    motion : object
        The option, for the advice of a warning.
    accept : float, optional
        The confidence from which on a fix is accepted.
    tolerance : int
        In places.
    """

    def __init__(self, motion: object, accept: float | None = None, tolerance: int = 1) -> None:
        self.motion, self.accept = motion, accept
        self.agreement = Agreement(tolerance)
        self.confidence, self.speed = array("f"), array("f")
        self.accepted = self.unsure = self.off = 0
        self.odometry = False

    def add(self, fix: Fix, advance: float | None, breaks: bool) -> None:
        """Counts a fix, with the advance before it, and whether frames are missing there."""
        track = fix.track
        if track is None:
            return
        self.odometry |= advance is not None
        self.confidence.append(track.confidence)
        self.speed.append(track.speed)
        self.accepted += self.accept is not None and track.confidence >= self.accept
        self.unsure += track.confidence < 0.5
        self.off += track.off_map > PERHAPS_OFF
        self.agreement.add(fix, breaks and advance is None)

    def lines(self) -> list[str]:
        """The track in a line, and a warning if trusted matches disagree with it."""
        count = len(self.confidence)
        if not count:
            return []
        sure = float(np.median(self.confidence))
        # Of ten frames each: in a slow drive, most single ones show the place before once more.
        some = min(10, count)
        pace = float(np.median(np.convolve(self.speed, np.full(some, 1 / some), "valid")))
        parts = [f"track: median confidence {sure:.2f}"]
        if self.accept is not None:
            share = f"{self.accepted / count:.0%}"
            parts.append(f"{self.accepted} accepted at {self.accept:g} ({share})")
        parts += [f"{self.unsure} below 0.5", f"{self.off} perhaps off the map"]
        parts.append(f"usual pace {pace:.2g} places a frame")
        lines = [", ".join(parts)]
        if disagreeing := self.agreement.disagreeing():
            off, pairs = disagreeing
            against, advice = "motion", "give --odometry"
            if self.odometry:
                against, advice = "odometry", "look at its scale (--places-per-metre) and its clock"
            elif self.motion != "any":
                advice = "use --motion any, or give --odometry"
            counts = f"{off} of {pairs} pairs a few frames apart"
            lines.append(
                f"warning: trusted matches disagree with the {against} in {counts}: {advice}"
            )
        return lines
