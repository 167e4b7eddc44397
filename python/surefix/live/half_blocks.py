"""An image on a terminal."""

import numpy as np
from numpy.typing import NDArray
from rich.color import Color
from rich.console import Console, ConsoleOptions, RenderResult
from rich.measure import Measurement
from rich.segment import Segment
from rich.style import Style

__all__ = ["HalfBlocks"]


class HalfBlocks:
    """An image in characters that are half foreground and half background: two pixels each.

    Parameters
    ----------
    image : uint8 array, (H, W) or (H, W, 3)
    width : int
        Characters wide, at most.
    lines : int, optional
        Characters high, at most; else as high as the image's shape asks for.
    """

    def __init__(self, image: NDArray[np.uint8], width: int, lines: int | None = None) -> None:
        if image.ndim == 2:
            image = np.repeat(image[:, :, None], 3, axis=2)
        tall, wide = image.shape[:2]
        if lines is not None:
            width = min(width, max(1, 2 * lines * wide // tall))
        self.width = min(width, wide)
        height = min(tall, max(2, round(self.width * tall / wide) // 2 * 2))
        rows = np.arange(height) * tall // height
        columns = np.arange(self.width) * wide // self.width
        sums = np.add.reduceat(
            np.add.reduceat(image, rows, axis=0, dtype=np.int64), columns, axis=1
        )
        heights, widths = np.diff(rows, append=tall), np.diff(columns, append=wide)
        self.pixels = (sums // np.outer(heights, widths)[:, :, None]).tolist()

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for upper, lower in zip(self.pixels[::2], self.pixels[1::2], strict=False):
            for above, below in zip(upper, lower, strict=True):
                yield Segment(
                    "▀", Style(color=Color.from_rgb(*above), bgcolor=Color.from_rgb(*below))
                )
            yield Segment.line()

    def __rich_measure__(self, console: Console, options: ConsoleOptions) -> Measurement:
        return Measurement(self.width, self.width)
