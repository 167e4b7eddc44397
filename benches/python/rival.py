"""The method in vectorised NumPy, SciPy and Pillow, as a careful user would write it."""

import numpy as np
import numpy.typing as npt

from work import Answer

WEIGHT, SMOOTHING = 0.99, 3
# The paper's image: its size, the patch that is normalized, and levels a deviation.
SMALL, PATCH, LEVELS = (64, 32), 8, 32


class ArrayMatcher:
    """Whole arrays at a time: windows of the newest queries, and `convolve2d` along diagonals."""

    def __init__(self, places: int, sequence_length: int) -> None:
        from scipy.signal import convolve2d

        self.convolve2d = convolve2d
        self.length = sequence_length
        # Space for the terms that the route's start lacks.
        self.gradients = np.zeros((SMOOTHING, places + SMOOTHING - 1), np.float32)
        self.columns = np.zeros((sequence_length, places), np.float32)
        self.single = np.zeros(sequence_length, np.int64)
        self.trusted = np.zeros(sequence_length, bool)
        self.along_gradients = np.eye(SMOOTHING, dtype=np.float32)
        self.along_columns = np.eye(sequence_length, dtype=np.float32)
        self.queries = np.arange(sequence_length)
        self.lowest = np.float32(np.inf)
        self.frames = 0

    def push(self, d: npt.NDArray[np.float32]) -> Answer:
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
        for window in (self.columns, self.single, self.trusted):
            window[:-1] = window[1:]
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


class ArrayLocalizer:
    """Pillow for the image, NumPy for the distances, and the matcher above."""

    def __init__(self, rows: npt.NDArray[np.uint8], sequence_length: int) -> None:
        from PIL import Image

        self.image, self.rows = Image, rows
        self.matcher = ArrayMatcher(len(rows), sequence_length)

    def describe(self, frame: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
        """Grey, small, normalized patch by patch, a byte each."""
        grey = self.image.fromarray(frame).convert("L")
        pixels = np.asarray(grey.resize(SMALL, self.image.Resampling.BILINEAR), np.float64)
        width, height = SMALL
        patches = pixels.reshape(height // PATCH, PATCH, width // PATCH, PATCH)
        mean = patches.mean(axis=(1, 3), keepdims=True)
        deviation = patches.std(axis=(1, 3), keepdims=True)
        z = np.where(deviation < 1, 0, (patches - mean) / np.maximum(deviation, 1))
        # Halves away from zero.
        levels = np.trunc(LEVELS * z + np.copysign(0.5, z))
        return np.clip(128 + levels, 0, 255).astype(np.uint8).ravel()

    def push(self, frame: npt.NDArray[np.uint8]) -> Answer:
        """Place, score and trust of one image."""
        query = self.describe(frame)
        # The fastest of NumPy's ways, and faster than SciPy's cdist: bytes all along.
        difference = np.maximum(self.rows, query) - np.minimum(self.rows, query)
        sums = difference.sum(axis=1, dtype=np.uint32)
        return self.matcher.push((sums / (query.size * LEVELS)).astype(np.float32))
