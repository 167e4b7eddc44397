"""One colour for each meaning, in every view: figures, reports, notebooks, rerun, the terminal.

Hue says right (blue) or wrong (orange), strength says trusted or not. If no truth is known, trusted
is the blue of right, and untrusted is grey. Four more hues: the true place, the peak of the
gradient, the least distance, and what is known beyond doubt (ink).
"""

from dataclasses import dataclass

__all__ = ["DARK", "LIGHT", "Colours"]


@dataclass(frozen=True)
class Colours:
    """The colours on one paper. Those of outcomes are from the Okabe-Ito set, or near it."""

    paper: str
    ink: str
    muted: str
    grid: str
    near: str
    """The darkest tone of a distance matrix: the smallest distances."""
    trusted_right: str
    trusted_wrong: str
    untrusted_right: str
    untrusted_wrong: str
    truth: str
    peak: str
    """The peak of the gradient."""
    nearest: str
    """The least distance."""

    @property
    def right(self) -> str:
        """A right match, if nothing is said of trust."""
        return self.trusted_right

    @property
    def wrong(self) -> str:
        """A wrong match, if nothing is said of trust."""
        return self.trusted_wrong

    @property
    def trusted(self) -> str:
        """A trusted match, if the truth is not known."""
        return self.trusted_right

    @property
    def untrusted(self) -> str:
        """An untrusted match, if the truth is not known."""
        return self.muted


LIGHT = Colours(
    paper="#ffffff",
    ink="#1c2127",
    muted="#5a646e",
    grid="#e2e6ea",
    near="#30363d",
    trusted_right="#0072b2",
    trusted_wrong="#d55e00",
    untrusted_right="#56b4e9",
    untrusted_wrong="#e69f00",
    truth="#009e73",
    peak="#a8548a",
    nearest="#8a7a00",
)

DARK = Colours(
    paper="#161b21",
    ink="#e8edf2",
    muted="#9ba7b3",
    grid="#2c343d",
    near="#cfd7df",
    trusted_right="#56b4e9",
    trusted_wrong="#ff7a2f",
    untrusted_right="#3484b5",
    untrusted_wrong="#b58117",
    truth="#2fbf95",
    peak="#cc79a7",
    nearest="#c9b400",
)
