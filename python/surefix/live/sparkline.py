"""The distances to all places as a line of bars."""

import numpy as np
from numpy.typing import NDArray
from rich.text import Text

from surefix import Fix
from surefix.live.colours import MINIMUM, PEAK
from surefix.live.strip import Strip

__all__ = ["sparkline"]

BLOCKS = " ▁▂▃▄▅▆▇█"
PLAIN = "_.:-=+*#"


def sparkline(
    distances: NDArray[np.float32], fix: Fix, strip: Strip, lines: int, unicode: bool
) -> Text:
    """Bars of the distances, pointed at by the gradient peak from above and by the minimum from
    below.

    Where the two arrows point at each other, the match is trusted.
    """
    values = strip.smallest(distances)
    low, high = float(values.min()), float(values.max())
    share = (values - low) / (high - low) if high > low else np.ones(len(values))
    text = Text(no_wrap=True, overflow="crop")
    _mark(text, strip.column(fix.gradient.place), "▼" if unicode else "v", PEAK)
    if unicode:
        # The smallest still has a bar: an eighth of a line.
        eighths = 1 + np.rint(share * (8 * lines - 1)).astype(int)
        for line in reversed(range(lines)):
            text.append(
                "".join(BLOCKS[level] for level in np.clip(eighths - 8 * line, 0, 8)) + "\n", "dim"
            )
    else:
        text.append(
            "".join(PLAIN[level] for level in np.rint(share * (len(PLAIN) - 1)).astype(int)) + "\n",
            "dim",
        )
    _mark(text, strip.column(fix.single.place), "▲" if unicode else "^", MINIMUM)
    text.right_crop(1)
    return text


def _mark(text: Text, column: int, mark: str, colour: str) -> None:
    text.append(" " * column)
    text.append(mark + "\n", f"bold {colour}")
