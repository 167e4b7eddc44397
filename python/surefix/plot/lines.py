"""How lines of one figure are told apart: by colour, dashes and marks, so that any one of the three
may be lost.
"""

from dataclasses import dataclass
from typing import Any

from surefix.errors import SurefixValueError
from surefix.plot.theme import Theme

__all__ = ["LOOKS", "Look", "looks"]

LOOKS = 8


@dataclass(frozen=True)
class Look:
    """The look of one line."""

    colour: str
    dashes: Any
    width: float
    mark: str

    def line(self, points: int, layer: int) -> dict[str, Any]:
        """What ``Axes.plot`` has to be told for a line of so many points, with a few marks on
        it.
        """
        # Each line's marks begin elsewhere, so that lines on top of each other show both.
        every = (0.02 + 0.017 * layer, 0.14) if points > 12 else None
        return {
            "color": self.colour,
            "linestyle": self.dashes,
            "linewidth": self.width,
            "marker": self.mark,
            "markersize": 5.5,
            "markevery": every,
            "zorder": 3 + (LOOKS - layer) / 10,
            "clip_on": False,
        }


def looks(theme: Theme, count: int) -> list[Look]:
    """The looks of ``count`` lines, the first the boldest; at most eight can be told apart."""
    if count > LOOKS:
        raise SurefixValueError(
            f"lines: expected at most {LOOKS} in one figure, got {count}; draw several figures"
        )
    styles: list[tuple[str, Any, float, str]] = [
        (theme.trusted_right, "-", 2.4, ""),
        (theme.trusted_wrong, (0, (5, 2)), 1.7, ""),
        (theme.ink, (0, (1, 1.5)), 1.7, ""),
        (theme.muted, "-.", 1.7, ""),
        (theme.fifth, "-", 1.5, "o"),
        (theme.sixth, (0, (5, 2)), 1.5, "s"),
        (theme.untrusted_right, (0, (1, 1.5)), 1.5, "^"),
        (theme.untrusted_wrong, "-.", 1.5, "D"),
    ]
    return [Look(*style) for style in styles[:count]]
