"""The oracle of the tracker (docs/method.md, 1.9) in plain NumPy, with the transition of each speed
as an explicit matrix. On a route of segments and links (1.14) the matrix of a move by `s` places is
a power of that of a single move.

It shares no code with the library: hubness and evidence come for all queries at once, and beliefs
are matrices (place, speed), divided by their total after each query.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from oracle import Array

OFF = 0.05
BY_WAY, BY_VIEW = 0.05, 0.1  # what a robot that stands still learns
TAIL = 0.025
FARTHEST = 64  # longer moves do not follow links
FINE, CHUNK = 65_536, 256  # of more places, intervals end with chunks


class Roads:
    """How places follow each other, as matrices from each place (row) to each."""

    def __init__(self, segments: Any) -> None:
        """Of `surefix.Segments`."""
        self.n = segments.places
        self.start, self.end, self.closed = np.zeros((3, self.n), int)
        for one in segments:
            here = slice(one.start, one.end)
            self.start[here], self.end[here], self.closed[here] = one.start, one.end, one.closed
        self.linked = np.zeros((self.n, self.n))
        for one, other in segments.links:
            self.linked[one, other] = 1.0
        self.loop = bool(len(segments) == 1 and self.closed.all())

    def along(self, by: int) -> Array:
        """`by` places along the segment."""
        length = self.end - self.start
        to = np.arange(self.n) - self.start + by
        inside = (to >= 0) & (to < length) | (self.closed == 1)
        moved = np.zeros((self.n, self.n))
        rows = np.flatnonzero(inside)
        moved[rows, (self.start + to % length)[rows]] = 1.0
        return moved

    def move(self, by: int) -> Array:
        """`by` places on, or back if it is below 0; by one link at most."""
        if not self.linked.any() or by == 0 or abs(by) > FARTHEST:
            return self.along(by)
        sign, steps = (1, by) if by > 0 else (-1, -by)
        natural, links = self.along(sign), self.linked if by > 0 else self.linked.T
        ways = np.maximum((natural + links).sum(1, keepdims=True), 1.0)
        straight, turn = natural / ways, links / ways
        # before[k]: k places that took no link; the link is the place after these.
        before, total = np.eye(self.n), np.zeros((self.n, self.n))
        for k in range(steps):
            total += before @ turn @ self.along(sign * (steps - 1 - k))
            before = before @ straight
        return total + before

    def near(self, place: int, tolerance: int) -> Array:
        """Which places are within the tolerance."""
        apart = np.abs(np.arange(self.n) - place)
        length = self.end - self.start
        apart = np.where(self.closed == 1, np.minimum(apart, length - apart), apart)
        return (self.start == self.start[place]) & (apart <= tolerance)


@dataclass(frozen=True)
class Tracked:
    """What is believed after each query."""

    belief: Array
    """In each place, (n, m)."""
    off: Array
    """Off the map, (m,)."""
    speeds: Array
    """The mean speed if the robot is in that place, (n, m)."""
    roads: Roads | None = None

    def confidence(self, query: int, place: int, tolerance: int) -> float:
        if self.roads is not None:
            return float(self.belief[self.roads.near(place, tolerance), query].sum())
        return float(self.belief[max(0, place - tolerance) : place + tolerance + 1, query].sum())

    def intervals(self, query: int, place: int, slack: float) -> tuple[set[int], set[int]]:
        """The first and the last place of 95 % of the belief, in which `place` is; all that it may
        be if a sum of beliefs is `slack` away. On a closed road they are counted from the place
        opposite. Of many places, ends far from `place` are those of their chunks.
        """
        n, first = len(self.belief), 0
        if self.roads is not None and self.roads.loop:
            first = (place + (n + 1) // 2) % n
            first -= first % CHUNK if n > FINE else 0
        counted = (place - first) % n
        belief = np.roll(self.belief[:, query], -first)
        on = belief.sum()
        below, above = np.cumsum(belief), np.cumsum(belief[::-1])
        tails = TAIL * on + np.array([-slack, slack])

        def first_above(sums: Array, tail: float) -> int:
            return int(np.argmax(sums > tail)) if (sums > tail).any() else n - 1

        def place_of(at: int, outwards: int) -> int:
            at = (at + first) % n
            if n <= FINE or abs(at // CHUNK - place // CHUNK) <= 1:
                return at
            return at - at % CHUNK if outwards < 0 else min(at - at % CHUNK + CHUNK, n) - 1

        low, high = ([first_above(sums, tail) for tail in tails] for sums in (below, above))
        lows = {min(at, counted) for at in range(low[0], low[1] + 1)}
        highs = {max(n - 1 - at, counted) for at in range(high[0], high[1] + 1)}
        return {place_of(at, -1) for at in lows}, {place_of(at, 1) for at in highs}


def evidence(D: Array, motion: Any) -> tuple[Array, Array]:
    """1.9, 1 and 2: `z` of each place and query, (n, m), and which queries say anything, (m,)."""
    says = np.ptp(D, axis=0) > 0
    sums = np.cumsum(np.where(says, D, 0.0), axis=1)
    k = np.cumsum(says)
    hubs = sums / np.maximum(k + motion.hubness, 1e-9)
    x = D - (hubs - hubs.mean(axis=0))
    deviation = x.std(axis=0)
    size = np.abs(D.mean(axis=0)) + np.abs(hubs.mean(axis=0))
    clear = says & (deviation > 1e-12 * size)
    z = (x - x.mean(axis=0)) / np.where(clear, deviation, 1.0)
    return np.where(clear, z, 0.0), says


def transition(
    n: int, move: float, jitter: float, reach: int = 1, roads: Roads | None = None
) -> Array:
    """1.9, 3: the probability to get from place `j` to place `i`, (n, n)."""
    p = min(jitter, 0.25 / reach)
    astray = np.full(2 * reach + 1, p)
    astray[reach] = 1 - 2 * reach * p
    whole = int(np.floor(move))
    chances = np.convolve([1 - (move - whole), move - whole], astray)
    by = whole - reach + np.arange(len(chances))
    if roads is not None:
        moved: Array = sum(
            chance * roads.move(int(places)) for places, chance in zip(by, chances, strict=True)
        )
        return moved.T
    of_move = np.zeros(2 * n - 1)  # from 1 - n to n - 1 places
    inside = np.abs(by) < n
    of_move[by[inside] + n - 1] = chances[inside]
    return np.lib.stride_tricks.sliding_window_view(of_move, n)[:, ::-1]


def speed_transitions(n: int, motion: Any, roads: Roads | None = None) -> list[Array]:
    """One for each speed. Jitter reaches half of the way to the farther neighbouring speed."""
    speeds = np.array(motion.speeds, float) * motion.pace
    gaps = np.concatenate([[0.0], np.diff(motion.speeds), [0.0]]) * motion.pace
    reaches = np.maximum(np.ceil(np.maximum(gaps[1:], gaps[:-1]) / 2), 1).astype(int)
    return [
        transition(n, v, motion.jitter if v else 0.0, int(reach), roads)
        for v, reach in zip(speeds, reaches, strict=True)
    ]


def switching(count: int, probability: float) -> Array:
    """From each speed (row) to each other."""
    if count == 1:
        return np.ones((1, 1))
    beside = np.eye(count, k=1) + np.eye(count, k=-1)
    return (1 - probability) * np.eye(count) + probability * beside / beside.sum(1, keepdims=True)


def steps(z: Array, a: float, before: int | None, now: int, motion: Any) -> tuple[float, ...]:
    """The shares of a whole step that the query `now` is after the query `before`: of evidence, of
    the motion, of all that may happen, and of the odometry's jitter.
    """
    if not np.isnan(a):
        way = float(np.clip(abs(a), BY_WAY, 1.0))
        return (way, 1.0, way, max(BY_WAY, abs(a))) if motion.by_distance else (way, 1.0, 1.0, 1.0)
    if before is None or motion.repeat == 1 or not (z[:, now].any() and z[:, before].any()):
        return (1.0,) * 4
    new = (1 - np.corrcoef(z[:, before], z[:, now])[0, 1]) / (1 - motion.repeat)
    moved = float(np.clip(2 * new, 0.0, 1.0))
    return float(np.clip(new, BY_VIEW, 1.0)), moved, max(moved, BY_VIEW), 1.0


def track(
    D: Array,
    motion: Any,
    advance: Array | None = None,
    gaps: Mapping[int, float | None] = {},
    total: float = 1 - OFF,
    segments: Any = None,
) -> Tracked:
    """1.9 for distances (n, m). `advance` (m,) is NaN if it is not known; `gaps` are before these
    queries, with the advance in them if it is known. `total` is the sum of the beliefs at the
    start. `segments` are the route's, if it is not one open segment.
    """
    D = np.asarray(D, np.float64)
    n, m = D.shape
    V = len(motion.speeds)
    z, says = evidence(D, motion)
    advance = np.full(m, np.nan) if advance is None else np.asarray(advance, float)
    roads = None if segments is None else Roads(segments)
    of_speeds, change = speed_transitions(n, motion, roads), switching(V, motion.switching)
    start = np.full((n, V), total / (n * V)), 1 - OFF, OFF
    b, on, off = start
    travelled, fresh, viewed = 0.0, True, None
    belief, offs, mean_speeds = np.empty((n, m)), np.empty(m), np.empty((n, m))
    for j in range(m):
        a = advance[j]
        if j in gaps:
            bridge = gaps[j]
            if bridge is None:
                (b, on, off), fresh, viewed = start, True, None
            else:
                a = bridge + (0.0 if np.isnan(a) else a)
        learnt, moves, happens, astray = (1.0,) * 4 if fresh else steps(z, a, viewed, j, motion)
        viewed = j if says[j] else viewed
        leave, restart, rejoin = (
            rate * happens for rate in (motion.leave, motion.restart, motion.rejoin)
        )
        keep = (1 - leave) * (1 - restart)
        if np.isnan(a):
            changed = b @ change
            moved = np.stack([T @ row for T, row in zip(of_speeds, changed.T, strict=True)], axis=1)
            stayed = (1 - moves) * changed
            speeds = np.array(motion.speeds) * motion.pace
        else:
            to = travelled + a
            by = a if motion.by_distance else np.rint(to) - np.rint(travelled)
            travelled, jitter = to, motion.jitter * astray
            moved = (transition(n, by, jitter, roads=roads) @ b.sum(axis=1))[:, None]
            stayed, speeds = np.zeros((n, 1)), np.array([a])
        left = moves * (on - moved.sum())
        anew = rejoin * off + (1 - leave) * restart * on + keep * left
        moving = keep * moves * moved + anew / moved.size
        predicted = moving + keep * stayed
        e = np.exp(-motion.evidence * learnt * np.clip(z[:, j], -motion.clip, motion.clip))
        off = ((1 - rejoin) * off + leave * on) * e.mean()
        b = predicted * e[:, None]
        on = b.sum()
        b, on, off, fresh = b / (on + off), on / (on + off), off / (on + off), False
        belief[:, j], offs[j] = b.sum(axis=1), off
        mean_speeds[:, j] = moving @ speeds / predicted.sum(axis=1)
        if b.shape[1] != V:  # all speeds are as likely after a known advance
            b = np.repeat(b / V, V, axis=1)
    return Tracked(belief, offs, mean_speeds, roads)
