"""What ``surefix run`` says at its end."""

from array import array
from pathlib import Path

import numpy as np

from surefix._words import counted
from surefix.cli.fixes import FixRow

__all__ = ["Tally"]


class Tally:
    """Counts fixes as they come; a drive of days fits in memory."""

    def __init__(self) -> None:
        self.latencies = array("f")
        self.trusted = self.dropped = self.gaps = 0
        # Whether the queries came to their end: not so after an error, nor after Ctrl-C.
        self.ended = False

    def add(self, row: FixRow) -> None:
        """Count one."""
        self.latencies.append(row.latency_us)
        self.trusted += row.fix.trusted
        if row.moment is not None:
            self.dropped += row.moment.dropped
            self.gaps += row.moment.gap

    def summary(self, out: Path | None) -> str:
        """One line: how many, how many of them are trusted, what is missing, how long they took,
        and where they are.
        """
        count = len(self.latencies)
        if not count:
            why = (
                "there was no query that could be used"
                if self.ended
                else "it stopped before the first"
            )
            return f"0 fixes: {why}"
        p50, p99, p999 = np.percentile(np.frombuffer(self.latencies, np.float32), (50, 99, 99.9))
        missing = f"{counted(self.dropped, 'frame')} dropped, " if self.dropped else ""
        missing += f"{counted(self.gaps, 'gap')}, " if self.gaps else ""
        where = "" if out is None else f", in {out}"
        return (
            f"{counted(count, 'fix', 'fixes')}, {self.trusted} trusted ({self.trusted / count:.0%}), {missing}"
            f"latency p50 {p50:.0f} us, p99 {p99:.0f} us, p99.9 {p999:.0f} us{where}"
        )
