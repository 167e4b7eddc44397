"""What would fit the matches better than a truth does."""

import numpy as np
import numpy.typing as npt

Places = npt.NDArray[np.int64]

# Places a query, or a true place: in order of plainness.
SLOPES = (1.0, -1.0, 2.0, 0.5, 3.0, 1 / 3, 4.0, 0.25, 5.0, 0.2, -2.0, -0.5)
# How much better a line must be: this many times as many right, and more by this share of all
# and by so many.
TIMES, SHARE, LEAST = 1.5, 0.3, 6
# A shift within the tolerance is told by this many times as many matches there.
CLEAR = 3


def better_fit(place: Places, truth: Places, tolerance: int = 1) -> str | None:
    """A line from the truth, or from the numbers of the queries, to the matched places that far
    more of them lie on, in words; None if the truth fits as well as any.

    Parameters
    ----------
    place : array of int, shape (m,)
        The single matches.
    truth : array of int, shape (m,)
        The true place of each query; -1 for none, or if it is not known.
    tolerance : int
        A match is right within this many places.

    Examples
    --------
    >>> import numpy as np
    >>> from surefix.study.fit import better_fit
    >>> better_fit(np.arange(0, 60, 2), np.arange(30))
    'place = 2 * query fits 30 of 30, the truth 2: is every 2nd place a query?'
    """
    known = np.flatnonzero(truth >= 0)
    if len(known) < 5:
        return None
    match, true = place[known], truth[known]
    right = int((np.abs(match - true) <= tolerance).sum())
    best: tuple[int, float, int, str] = (right, 1.0, 0, "truth")
    same = np.array_equal(true, known)
    for name, x in (("truth", true), ("query", known)):
        if same and name == "truth":
            continue
        for slope in SLOPES:
            shift, count = _line(match, slope * x, tolerance)
            if count > best[0]:
                best = count, slope, shift, name
    count, slope, shift, name = best
    if count >= TIMES * right + max(LEAST, SHARE * len(known)):
        fits = f"fits {count} of {len(known)}, the truth {right}"
        return f"place = {_said(slope, shift, name)} {fits}{_why(slope, shift)}"
    return _shifted(match, true, tolerance)


def _line(match: Places, along: npt.NDArray[np.floating], near: int) -> tuple[int, int]:
    """The shift with which most matches lie on a line, and how many do."""
    apart = match - np.round(along).astype(np.int64)
    low = int(apart.min())
    counts = np.bincount(apart - low)
    if near:
        padded = np.pad(counts, near)
        counts = np.convolve(padded, np.ones(2 * near + 1, int), "valid")
    # Of several shifts the one in the middle, where most lie exactly.
    top = np.flatnonzero(counts == counts.max())
    return int(top[len(top) // 2]) + low, int(counts.max())


def _shifted(match: Places, true: Places, tolerance: int) -> str | None:
    """A shift within the tolerance, which counts as right and is none the less a mistake."""
    apart = match - true
    counts = {step: int((apart == step).sum()) for step in range(-tolerance, tolerance + 1)}
    step = max(counts, key=lambda each: (counts[each], -abs(each)))
    if step == 0 or counts[step] < max(CLEAR * counts[0] + 10, len(true) // 2):
        return None
    why = ": does it count from 1?" if step == -1 else ""
    exact = f"is exact for {counts[step]} of {len(true)}, the truth for {counts[0]}"
    return f"place = truth {step:+d} {exact}{why}"


def _said(slope: float, shift: int, name: str) -> str:
    by = {1.0: name, -1.0: f"-{name}"}.get(slope)
    if by is None:
        by = f"{slope:g} * {name}" if abs(slope) > 1 else f"{name} / {1 / slope:g}"
    return by if not shift else f"{by} {'+' if shift > 0 else '-'} {abs(shift)}"


def _why(slope: float, shift: int) -> str:
    """What it may come from, as a question."""
    if slope > 1:
        return f": is every {_nth(round(slope))} place a query?"
    if 0 < slope < 1:
        return f": is every {_nth(round(1 / slope))} query a place?"
    if slope < 0:
        return ": is one of them in the other direction?"
    return ": does it count from 1?" if shift == -1 else ": does one of them begin later?"


def _nth(number: int) -> str:
    ending = {2: "nd", 3: "rd"}.get(number, "th")
    return f"{number}{ending}"
