"""The rival of ``Matcher.push``: the same step in vectorised NumPy and SciPy, as a careful user
would write it.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix import Fix

__all__ = ["WEIGHT", "ArrayMatcher", "same_fixes", "summary"]

WEIGHT = 0.99
SMOOTHING = 3
Floats = npt.NDArray[np.float32]
# Place, score, trusted: what a fix says.
Answer = tuple[int, float, bool]


class ArrayMatcher:
    """Whole arrays at a time: windows of the newest queries, a row each, and ``convolve2d`` along
    their diagonals.
    """

    def __init__(self, signal: Any, places: int, sequence_length: int) -> None:
        self.convolve2d = signal.convolve2d
        self.length = sequence_length
        # Room for the terms that the route's start lacks.
        self.gradients = np.zeros((SMOOTHING, places + SMOOTHING - 1), np.float32)
        self.columns = np.zeros((sequence_length, places), np.float32)
        self.single = np.zeros(sequence_length, np.int64)
        self.trusted = np.zeros(sequence_length, bool)
        self.along_gradients = np.eye(SMOOTHING, dtype=np.float32)
        self.along_columns = np.eye(sequence_length, dtype=np.float32)
        self.queries = np.arange(sequence_length)
        self.lowest = np.float32(np.inf)
        self.frames = 0

    def push(self, d: Floats) -> Answer:
        """Place, score and trust of one query."""
        g = self.gradients
        g[:-1] = g[1:]
        newest = g[-1, SMOOTHING - 1 :]
        newest[1:-1] = 0.5 * (d[2:] + d[:-2]) - d[1:-1]
        newest[0], newest[-1] = d[1] - d[0], d[-2] - d[-1]
        mean = ((d[1] - d[0]) + (d[-2] - d[-1])) / np.float32(2 * d.size)
        g[:, : SMOOTHING - 1] = mean
        if self.frames < SMOOTHING - 1:
            g[: SMOOTHING - 1 - self.frames] = mean
        enhanced = self.convolve2d(g, self.along_gradients, mode="valid")[0]

        place, peak = int(d.argmin()), int(enhanced.argmax())
        self.columns[:-1], self.single[:-1], self.trusted[:-1] = (
            self.columns[1:],
            self.single[1:],
            self.trusted[1:],
        )
        self.columns[-1], self.single[-1], self.trusted[-1] = d, place, abs(peak - place) <= 1
        self.lowest = min(self.lowest, d[place])
        self.frames += 1
        if self.frames < self.length:
            return place, float(d[place]), bool(self.trusted[-1])

        cells = self.queries[self.trusted], self.single[self.trusted]
        raw = self.columns[cells]
        self.columns[cells] = raw - WEIGHT * (raw - self.lowest)
        sums = self.convolve2d(self.columns, self.along_columns, mode="valid")[0]
        self.columns[cells] = raw
        best = int(sums.argmin())
        return best + self.length - 1, float(sums[best]) / self.length, bool(self.trusted[-1])


def summary(fix: Fix) -> Answer:
    """What a fix says, in the rival's words."""
    return fix.place, fix.score, fix.trusted


def same_fixes(ours: Sequence[Answer], theirs: Sequence[Answer], tolerance: float = 1e-4) -> str:
    """What is wrong: places and trust must be the same, scores within float32's rounding of a
    sum.
    """
    for query, (mine, other) in enumerate(zip(ours, theirs, strict=True)):
        close = abs(mine[1] - other[1]) <= tolerance * max(1e-3, abs(other[1]))
        if mine[0] != other[0] or mine[2] != other[2] or not close:
            return f"query {query}: surefix says {mine}, the rival {other}"
    return ""
