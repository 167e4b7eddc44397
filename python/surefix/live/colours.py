"""The colours of both views: hue says what a mark is, and the shape or the place says it again."""

__all__ = ["FAINT", "HERE", "MINIMUM", "PEAK", "TRUSTED", "UNTRUSTED"]

TRUSTED = "#2fbf95"
UNTRUSTED = "#8a96a3"
MINIMUM = "#56b4e9"
PEAK = "#e69f00"
FAINT = "#5b6672"
HERE = "#f4f7fa"
