"""The oracle of loop closure (docs/method.md, 1.14) in plain NumPy: the tracker's mathematics on a
matrix of all frames with all, of which each query sees the upper part.

It shares no code with the library.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from oracle import Array
from oracle_track import speed_transitions, steps, switching, transition


@dataclass(frozen=True)
class Closed:
    """What is believed after each frame of a drive."""

    belief: Array
    """In each place, (n, m); 0 in places that a frame is not compared with."""
    off: Array
    """Off the map, (m,)."""
    segment: Array
    """Which segment each place is in, (m,)."""

    def place(self, frame: int) -> int:
        return int(self.belief[:, frame].argmax())

    def confidence(self, frame: int, tolerance: int) -> float:
        at, places = self.place(frame), np.arange(len(self.off))
        near = (np.abs(places - at) <= tolerance) & (self.segment == self.segment[at])
        return float(self.belief[near, frame].sum())


def evidence(
    D: Array, exclude: int, hubness: float, clip: float, blank: Collection[int] = ()
) -> tuple[Array, Array]:
    """`z` of each place and query, (m, m): 0 in places that a query is not compared with; and which
    queries say anything, (m,). `D[i, j]` is the distance between the frames `i` and `j`.
    """
    m = len(D)
    z, says = np.zeros((m, m)), np.zeros(m, bool)
    deviations, columns = np.zeros(m), np.zeros(m)
    seen = np.array([i not in blank for i in range(m)])
    for j in range(exclude + 2, m):
        n = j - exclude
        d = D[:n, j].astype(np.float64)
        if j in blank or not seen[:n].any():
            continue
        d[~seen[:n]] = np.float32(d[seen[:n]].mean())
        says[j] = np.ptp(d) > 0
        if not says[j]:
            continue
        deviations[:n] += d - d.mean()
        columns[:n] += 1
        x = d - deviations[:n] / (columns[:n] + hubness)
        if x.std() > 1e-12 * np.abs(d.mean()):
            z[:n, j] = np.clip((x - x.mean()) / x.std(), -clip, clip)
    return z, says


def close(
    D: Array,
    motion: Any,
    exclude: int,
    advance: Array | None = None,
    blank: Collection[int] = (),
    gaps: Collection[int] = (),
) -> Closed:
    """The filter over a drive's frames, off the map at the start, and after gaps, which come before
    these frames.
    """
    m, V = len(D), len(motion.speeds)
    advance = np.full(m, np.nan) if advance is None else advance
    z, says = evidence(D, exclude, motion.hubness, motion.clip, blank)
    of_speeds = [np.ascontiguousarray(T) for T in speed_transitions(m, motion)]
    change = switching(V, motion.switching)
    b, on, off = np.zeros((m, V)), 0.0, 1.0
    belief, offs, viewed, fresh, travelled = np.zeros((m, m)), np.ones(m), None, True, 0.0
    for j in range(exclude + 2, m):
        n, a = j - exclude, advance[j]
        segment = np.searchsorted(sorted(gaps), np.arange(n), side="right")
        together = segment[:, None] == segment
        if j in gaps:
            b[:], on, off, viewed, fresh = 0.0, 0.0, 1.0, None, True
        learnt, moves, happens, astray = (1.0,) * 4
        if not fresh:
            learnt, moves, happens, astray = steps(z[:n], a, viewed, j, motion)
        viewed = j if says[j] else viewed
        leave, restart, rejoin = (
            rate * happens for rate in (motion.leave, motion.restart, motion.rejoin)
        )
        keep = (1 - leave) * (1 - restart)
        if np.isnan(a):
            changed = (b @ change)[:n]
            moved = np.stack(
                [(T[:n, :n] * together) @ row for T, row in zip(of_speeds, changed.T, strict=True)],
                axis=1,
            )
            stayed = (1 - moves) * changed
        else:
            to = travelled + a
            by = a if motion.by_distance else np.rint(to) - np.rint(travelled)
            travelled = to
            T = transition(m, by, motion.jitter * astray)[:n, :n] * together
            moved, stayed = (T @ b[:n].sum(axis=1))[:, None], np.zeros((n, 1))
        anew = rejoin * off + (1 - leave) * restart * on + keep * moves * (on - moved.sum())
        predicted = keep * (moves * moved + stayed) + anew / moved.size
        e = np.exp(-motion.evidence * learnt * z[:n, j])
        off = ((1 - rejoin) * off + leave * on) * e.mean()
        now = predicted * e[:, None]
        total = now.sum() + off
        now, on, off, fresh = now / total, now.sum() / total, off / total, False
        belief[:n, j], offs[j] = now.sum(axis=1), off
        b[:n] = now if now.shape[1] == V else now / V
    return Closed(belief, offs, np.searchsorted(sorted(gaps), np.arange(m), side="right"))
