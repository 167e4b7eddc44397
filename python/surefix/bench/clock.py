"""Times of several things side by side: by turns, so that what disturbs the machine disturbs
all.
"""

import gc
import statistics
import time
from collections.abc import Callable, Sequence
from typing import Any

__all__ = ["interleaved"]

# A shorter batch would measure the clock and the caches of the one before.
BATCH = 1e-3


def interleaved(
    calls: Sequence[Callable[[], Any]],
    seconds: float,
    rounds: int,
    clocks: Sequence[Callable[[], float] | None],
) -> list[float]:
    """The median seconds of one call of each, in at least so many rounds and for at least so long.

    In a round each takes its turn, several calls in a row where a call is short; who begins changes
    with each round. Where there is a clock, it gives the seconds itself.
    """
    collecting = gc.isenabled()
    gc.disable()
    try:
        counts = [1 if clock else _count(call) for call, clock in zip(calls, clocks, strict=True)]
        took: list[list[float]] = [[] for _ in calls]
        begin = time.perf_counter()
        done = 0
        while done < rounds or time.perf_counter() - begin < seconds:
            for turn in range(len(calls)):
                which = (turn + done) % len(calls)
                took[which].append(_turn(calls[which], counts[which], clocks[which]))
            done += 1
    finally:
        if collecting:
            gc.enable()
    return [statistics.median(each) for each in took]


def _turn(call: Callable[[], Any], count: int, clock: Callable[[], float] | None) -> float:
    """The mean seconds of a call in one turn."""
    if clock:
        return clock()
    if count > 1:
        # Once untimed: the caches hold what the one before has used, and in a loop they would hold
        # its own.
        call()
    return _mean(call, count)


def _count(call: Callable[[], Any]) -> int:
    """How many calls make a batch; finding out warms up as well."""
    count = 1
    while True:
        # One time may be the system's own; three are not.
        mean = min(_mean(call, count) for _ in range(1 if count == 1 else 3))
        if mean * count >= BATCH / 4:
            return max(1, round(BATCH / mean))
        count *= 4


def _mean(call: Callable[[], Any], count: int) -> float:
    start = time.perf_counter()
    for _ in range(count):
        call()
    return (time.perf_counter() - start) / count
