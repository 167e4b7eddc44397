"""The fixes of ``surefix run``: as rows, and in sum."""

from array import array
from pathlib import Path

import numpy as np
import numpy.typing as npt

from surefix import Fix
from surefix._words import plural
from surefix.cli.tracked import Tracked
from surefix.frames import Frame
from surefix.tables.fix_files import Row

ALARM = (
    "warning: from frame {} on, scores are worse than on the calibration drive: what is promised "
    "may not hold; calibrate anew"
)

FROZEN = "warning: the camera is frozen: {} repeat the one before, {} to {}{}"
# A camera at rest has noise: it never sees the same this many times.
FROZEN_FROM = 10


def row_of(
    frame: Frame,
    fix: Fix,
    place_name: str | None,
    latency: float,
    timed: bool,
    accept: float | None = None,
    degrees: npt.NDArray[np.float64] | None = None,
) -> Row:
    """The columns of a fix, None for an empty one; those of the track, of a bar to ``accept``, of
    the position, and times and drops (``timed``) only if there are any. ``degrees`` are those of
    all places.
    """
    sequence, track = fix.sequence, fix.track
    row: Row = {
        "frame": fix.frame,
        "query": frame.name,
        "place": fix.place,
        "place_name": place_name,
        "score": fix.score,
        "trusted": fix.trusted,
        "blank": fix.blank,
        "ready": sequence is not None,
        "anchors": None if sequence is None else sequence.anchors,
        "speed": fix.speed,
        "single_place": fix.single.place,
        "single_distance": fix.single.distance,
        "gradient_place": fix.gradient.place,
        "gradient_value": fix.gradient.value,
        # In microseconds.
        "latency_us": round(latency, 1),
    }
    if timed:
        row |= {"time": frame.time, "dropped": frame.dropped, "gap": frame.gap}
    if track is not None:
        low, high = track.interval
        row |= {"confidence": track.confidence, "off_map": track.off_map}
        row |= {"place_low": low, "place_high": high}
        # The paper's own answer, since place and score are the track's.
        row["sequence_place"] = None if sequence is None else sequence.place
        row["sequence_score"] = None if sequence is None else sequence.score
    if accept is not None and track is not None:
        row["accepted"] = track.confidence >= accept
    elif fix.accepted is not None:
        row |= {"accepted": fix.accepted, "probability": fix.probability}
    row |= {"segment": fix.segment, "segment_place": fix.segment_place}
    if (at := fix.position) is not None:
        row |= {name: round(metres, 4) for name, metres in zip("xyz", at.metres, strict=False)}
        if degrees is not None:
            where = degrees[fix.place].tolist()
            row["latitude"], row["longitude"] = (round(each, 9) for each in where)
    return row


class Repeats:
    """Counts queries that are the one before again, by their best match: its place and distance."""

    def __init__(self) -> None:
        self.before: tuple[int, float] | None = None
        self.run = 0
        # Of the runs that are long enough: all queries, and the first and last of the first run.
        self.count = self.stretches = 0
        self.first = self.last = 0

    def add(self, fix: Fix) -> None:
        match = None if fix.blank else (fix.single.place, fix.single.distance)
        self.run = self.run + 1 if match is not None and match == self.before else 0
        self.before = match
        if self.run < FROZEN_FROM:
            return
        new = self.run == FROZEN_FROM
        self.count += FROZEN_FROM if new else 1
        self.stretches += new
        if self.stretches == 1:
            self.first, self.last = fix.frame - self.run + 1, fix.frame

    def lines(self) -> list[str]:
        more = self.stretches - 1
        others = f", and {plural(more, 'more stretch', 'more stretches')}" if more > 0 else ""
        frames = plural(self.count, "frame")
        return [FROZEN.format(frames, self.first, self.last, others)] if self.count else []


class Summary:
    """Counts fixes as they come; a drive of days fits in memory. It takes what ``Tracked`` does."""

    def __init__(
        self, motion: object = None, accept: float | None = None, tolerance: int = 1
    ) -> None:
        self.track = Tracked(motion, accept, tolerance)
        self.latencies = array("f")
        self.trusted = self.blank = self.dropped = self.gaps = 0
        self.repeats = Repeats()
        # By the threshold of settings, and the frame at which its alarm was raised.
        self.accepted = 0
        self.judged = False
        self.alarm: int | None = None
        # Whether the queries came to their end: not so after an error, nor after Ctrl-C.
        self.ended = False

    def add(self, frame: Frame, fix: Fix, latency: float, alarm: bool = False) -> None:
        """Counts a fix, after which the ``alarm`` of its threshold is raised or not."""
        self.judged |= fix.accepted is not None
        self.accepted += fix.accepted is True
        if alarm and self.alarm is None:
            self.alarm = fix.frame
        self.latencies.append(latency)
        self.trusted += fix.trusted
        self.blank += fix.blank
        self.repeats.add(fix)
        self.dropped += frame.dropped
        self.gaps += frame.gap
        self.track.add(fix, frame.advance, frame.breaks)

    def lines(self, out: Path | None) -> list[str]:
        """The fixes, the trusted ones, those of queries that show nothing, dropped frames, gaps,
        latencies, and the file, in a line; the track, if there is one; and whether the camera was
        frozen.
        """
        count = len(self.latencies)
        if not count:
            none, stopped = "there was no query that could be used", "it stopped before the first"
            return [f"0 fixes: {none if self.ended else stopped}"]
        p50, p99, p999 = np.percentile(np.frombuffer(self.latencies, np.float32), (50, 99, 99.9))
        missing = f"{self.blank} blank, " if self.blank else ""
        missing += f"{plural(self.dropped, 'frame')} dropped, " if self.dropped else ""
        missing += f"{plural(self.gaps, 'gap')}, " if self.gaps else ""
        where = "" if out is None else f", in {out}"
        counts = (
            f"{plural(count, 'fix', 'fixes')}, {self.trusted} trusted "
            f"({self.trusted / count:.0%}), {missing}latency p50 {p50:.0f} us, p99 {p99:.0f} us, "
            f"p99.9 {p999:.0f} us{where}"
        )
        judged = [f"{self.accepted} accepted ({self.accepted / count:.0%})"] if self.judged else []
        if self.alarm is not None:
            judged.append(ALARM.format(self.alarm))
        return [counts, *self.track.lines(), *judged, *self.repeats.lines()]
