"""Options of the methods: what is allowed, and an error that says so."""

from numbers import Real
from operator import index
from typing import SupportsFloat, SupportsIndex

from surefix.errors import SurefixValueError

__all__ = ["number", "whole"]


def whole(name: str, value: SupportsIndex, low: int, high: int | None = None, why: str = "") -> int:
    """A whole number from ``low``, up to ``high`` where there is one; ``why`` says where ``high``
    comes from.
    """
    expected = (
        f"a whole number of {low} or more"
        if high is None
        else f"a whole number from {low} to {high}{why}"
    )
    try:
        got = index(value)
    except TypeError:
        raise SurefixValueError(f"option `{name}`: expected {expected}, got {value!r}") from None
    if got < low or (high is not None and got > high):
        raise SurefixValueError(f"option `{name}`: expected {expected}, got {got}")
    return got


def number(name: str, value: SupportsFloat, low: float, high: float | None = None) -> float:
    """A finite number from ``low``, up to ``high`` where there is one."""
    expected = (
        f"a finite number of {low:g} or more"
        if high is None
        else f"a number from {low:g} to {high:g}"
    )
    got = float(value) if isinstance(value, Real) else float("nan")
    if not (low <= got < float("inf")) or (high is not None and got > high):
        raise SurefixValueError(f"option `{name}`: expected {expected}, got {value!r}")
    return got
