"""Where on the route the drive is, and where it has been."""

import numpy as np
from rich.text import Text

from surefix import Fix
from surefix.live.colours import TRUSTED
from surefix.live.strip import Strip

__all__ = ["RouteBar"]

AHEAD, PASSED, KNOWN = 0, 1, 2


class RouteBar:
    """The map's places in order: trusted fixes were here, others were there, and the rest is
    unseen.
    """

    def __init__(self, places: int) -> None:
        self.state = np.zeros(places, np.uint8)
        self.here = 0

    def add(self, fix: Fix) -> None:
        """Take one fix."""
        self.here = fix.place
        self.state[fix.place] = max(int(self.state[fix.place]), KNOWN if fix.trusted else PASSED)

    def draw(self, strip: Strip, unicode: bool) -> Text:
        """The bar, and below it an arrow to the newest fix."""
        marks = "·░█" if unicode else ".-#"
        text = Text(no_wrap=True, overflow="crop")
        for state in strip.largest(self.state).tolist():
            text.append(marks[state], TRUSTED if state == KNOWN else "dim")
        text.append("\n" + " " * strip.column(self.here))
        text.append("▲" if unicode else "^", "bold")
        return text
