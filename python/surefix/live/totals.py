"""What a drive comes to so far."""

from collections import deque

import numpy as np

from surefix import Fix
from surefix.live.view import Seen

__all__ = ["Totals"]


class Totals:
    """Counts since the start; latency and pace of the newest pushes. Its memory does not grow."""

    NEWEST = 1000

    def __init__(self) -> None:
        self.fixes = 0
        self.trusted = 0
        self.dropped = 0
        self.gaps = 0
        self.since_trusted = 0
        self.latency: deque[float] = deque(maxlen=self.NEWEST)
        self.times: deque[float] = deque(maxlen=61)

    def add(self, seen: Seen, fix: Fix, latency_us: float, now: float) -> None:
        """Take one frame and its fix; ``now`` in seconds, of any clock."""
        self.fixes += 1
        self.trusted += fix.trusted
        self.dropped += seen.dropped
        self.gaps += seen.gap
        self.since_trusted = 0 if fix.trusted else self.since_trusted + 1
        self.latency.append(latency_us)
        self.times.append(now)

    def __str__(self) -> str:
        """In words."""
        if not self.fixes:
            return "no fixes yet"
        p50, p99 = np.percentile(self.latency, (50, 99))
        parts = [f"{self.trusted / self.fixes:.0%} trusted ({self.trusted} of {self.fixes})"]
        if self.trusted and self.since_trusted:
            parts.append(
                f"the last {self.since_trusted} frame{'s' if self.since_trusted > 1 else ''} ago"
            )
        elapsed = self.times[-1] - self.times[0]
        if elapsed > 0:
            parts.append(f"{(len(self.times) - 1) / elapsed:.0f} frames a second")
        parts.append(f"{p50:.0f} us a push, p99 {p99:.0f}")
        parts.append(
            f"{self.dropped} dropped"
            + (f", {self.gaps} gap{'s' if self.gaps > 1 else ''}" if self.gaps else "")
        )
        return " · ".join(parts)
