"""Objects as HTML for notebooks: a small table and a drawing, without matplotlib.

Text and lines take the notebook's own colour; the hues are seen on light and on dark paper.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix._colours import LIGHT
from surefix._core import Alignment, Evaluation, Map, Run
from surefix._words import escaped, plural

__all__ = ["of_alignment", "of_audit", "of_evaluation", "of_map", "of_run"]

# A drawing has no more points, in this many pixels.
POINTS = 600
WIDTH, HEIGHT = 360, 150
# A confidence that counts as sure.
SURE = 0.95

CELL = "padding:2px 14px 2px 0;text-align:left;vertical-align:top;border:0;background:none"
Floats = npt.NDArray[np.float64]


def of_map(route: Map) -> str:
    """A map: its descriptors, its route, and the route from above if it has positions."""
    size = len(route) * route.dim * route.dtype.itemsize / 1e6
    rows = [
        ("places", f"{len(route):,}"),
        ("descriptor", f"{route.dim} x {route.dtype}, {route.metric}, {size:.1f} MB"),
    ]
    recipe = route.recipe or {}
    if "name" in recipe:
        rows.append(("of", str(recipe["name"])))
    if len(route.segments) > 1:
        rows.append(("segments", f"{len(route.segments)}"))
    if len(route.blank):
        rows.append(("places that show nothing", f"{len(route.blank)}"))
    if route.positions is None:
        return _whole("Map", rows)
    metres = route.positions[:, :2]
    extent = np.ptp(metres, axis=0)
    rows.append(("positions", f"{extent[0]:.0f} m x {extent[1]:.0f} m"))
    # As long across as up.
    scale = max(float(extent[0]) / WIDTH, float(extent[1]) / HEIGHT, 1e-9)
    at = (metres - metres.min(axis=0)) / scale
    at[:, 1] = HEIGHT - at[:, 1]
    lines = [
        _line(_thinned(at[segment.start : segment.end]), "currentColor", 1.5)
        for segment in route.segments
    ]
    return _whole("Map", rows, _svg(lines, "the route from above"))


def of_run(run: Run) -> str:
    """A run: how many fixes are trusted and sure, and the place of each query."""
    m = len(run)
    trusted = run.trusted
    rows = [("queries", f"{m:,}"), ("trusted", _share(trusted))]
    if run.confidence is None or run.off_map is None:
        rows.append(("with a sequence", _share(run.ready)))
    else:
        rows.append((f"confidence {SURE} or more", _share(run.confidence >= SURE)))
        rows.append(("probably off the map", _share(run.off_map >= 0.5)))
    if run.blank.any():
        rows.append(("show nothing", _share(run.blank)))
    kinds = [
        (~trusted, "currentColor", 2.0, "not trusted"),
        (trusted, LIGHT.trusted, 3.5, "trusted"),
    ]
    return _whole("Run", rows, _places(run.place, run.segments.places, kinds))


def of_alignment(alignment: Alignment) -> str:
    """An alignment: how much of it is sure, and the place of each query."""
    sure, off = alignment.confidence >= SURE, alignment.off_map >= 0.5
    doubtful = ~sure & ~off
    rows = [
        ("queries", f"{len(alignment):,}"),
        (f"confidence {SURE} or more", _share(sure)),
        ("doubtful", _share(doubtful)),
        ("probably off the map", _share(off)),
    ]
    kinds = [(doubtful, LIGHT.wrong, 3.0, "doubtful"), (sure & ~off, LIGHT.trusted, 2.5, "sure")]
    places = alignment.segments.places
    return _whole("Alignment", rows, _places(alignment.place, places, kinds))


def of_evaluation(curve: Evaluation) -> str:
    """A precision-recall curve and its figures."""
    rows = [
        ("queries judged", f"{curve.judged:,}"),
        ("correct matches", f"{curve.correct:,}"),
        ("area up to recall 0.2", f"{curve.auc(0.2):.3f}"),
        ("area up to recall 1", f"{curve.auc(1.0):.3f}"),
        ("recall at precision 1", f"{curve.recall_at_precision(1.0):.3f}"),
        ("largest recall", f"{curve.max_recall:.3f}"),
    ]
    side = HEIGHT
    drawn = [_line(np.array([[0, 0], [0, side], [side, side]]), "currentColor", 1.0)]
    if len(curve.recall):
        at = np.stack([curve.recall, curve.precision], axis=1)
        at = np.vstack([[0, curve.precision[0]], at])
        drawn.append(_line(_thinned(at * (side, -side) + (0, side)), LIGHT.right, 2.0))
    words = "precision (up) over recall, both from 0 to 1"
    return _whole("Evaluation", rows, _svg(drawn, words, (side, side)))


def of_audit(audit: Any) -> str:
    """An audit: each technique's estimates, with their intervals."""
    several = {f"technique {k}": one for k, one in enumerate(audit.techniques)}
    rows = [("queries", f"{len(audit):,}", "")]
    for name, one in {"fused" if several else "": audit, **several}.items():
        shares = [("recall@1", one.recall_at_1), ("trusted precision", one.trusted_precision)]
        if one.confirmed is not None:
            shares.append(("confirmed", one.confirmed_share))
        for what, share in shares:
            words = f"{name}: {what}" if name else what
            known = not np.isnan(share)
            said, bar = (str(share), _interval(share)) if known else ("none to judge", "")
            rows.append((words, said, bar))
    return _whole("Audit", rows)


def _interval(share: Any) -> str:
    """An estimate with its interval, on a line from 0 to 1."""
    width, height = 160, 8
    low, middle, high = (width * float(x) for x in (share.low, share, share.high))
    y = height / 2
    ends = [_line(np.array([[x, 0], [x, height]]), "currentColor", 1.0) for x in (0, width)]
    line = _line(np.array([[low, y], [high, y]]), LIGHT.right, 2.5)
    dot = _dots(np.array([[middle, y]]), LIGHT.right, 8.0)
    return _drawn([*ends, line, dot], "the estimate and its interval, from 0 to 1", (width, height))


def _share(which: npt.NDArray[np.bool_]) -> str:
    count = int(which.sum())
    return f"{count:,} ({count / max(1, len(which)):.1%})"


def _places(
    place: npt.NDArray[np.int64],
    places: int,
    kinds: Sequence[tuple[npt.NDArray[np.bool_], str, float, str]],
) -> str:
    """The place (up) of each query (across), in dots of some kinds: which, colour, size, name."""
    m = len(place)
    shown = np.linspace(0, max(0, m - 1), min(m, POINTS)).round().astype(np.int64)
    at = np.stack(
        [shown * WIDTH / max(1, m - 1), HEIGHT - place[shown] * HEIGHT / max(1, places - 1)], 1
    )
    dots = [_dots(at[which[shown]], colour, size) for which, colour, size, _ in kinds]
    corner = np.array([[0, 0], [0, HEIGHT], [WIDTH, HEIGHT]])
    named = ", ".join(
        f'<span style="color:{colour}">&#9679;</span> {escaped(name)}'
        for _, colour, _, name in reversed(kinds)
    )
    words = f"place (up) of {plural(m, 'query', 'queries')} (across)"
    return _svg([_line(corner, "currentColor", 1.0), *dots], words, key=named)


def _thinned(at: Floats) -> Floats:
    """As many of the points as a drawing has, with both ends."""
    rows = np.linspace(0, max(0, len(at) - 1), min(len(at), POINTS)).round().astype(np.int64)
    return np.asarray(at[rows], np.float64)


def _line(at: npt.NDArray[Any], colour: str, width: float) -> str:
    path = "L".join(f"{x:.1f} {y:.1f}" for x, y in at.tolist())
    return f'<path d="M{path}" fill="none" stroke="{colour}" stroke-width="{width:g}"/>'


def _dots(at: Floats, colour: str, size: float) -> str:
    """Lines without length and with round ends: the shortest way to write dots."""
    path = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in at.tolist())
    look = f'stroke="{colour}" stroke-width="{size:g}" stroke-linecap="round"'
    return f'<path d="{path}" fill="none" {look}/>' if path else ""


def _svg(
    parts: Iterable[str], words: str, size: tuple[int, int] = (WIDTH, HEIGHT), key: str = ""
) -> str:
    """A drawing with its description, and below it a line in words."""
    said = f"{escaped(words)}{'; ' if key else ''}{key}"
    look = "font-size:smaller;opacity:0.85"
    return f'{_drawn(parts, words, size)}<div style="{look}">{said}</div>'


def _drawn(parts: Iterable[str], words: str, size: tuple[int, int]) -> str:
    width, height = size
    view = f'viewBox="-5 -5 {width + 10} {height + 10}" width="{width + 10}"'
    start = f'<svg {view} height="{height + 10}" role="img" aria-label="{escaped(words)}">'
    return f"{start}{''.join(parts)}</svg>"


def _whole(title: str, rows: Sequence[tuple[str, ...]], drawing: str = "") -> str:
    """The rows, each of a name, a value and perhaps a drawing; and a drawing beside them."""
    cells = "".join(
        f'<tr style="background:none"><td style="{CELL}">{escaped(name)}</td>'
        f'<td style="{CELL}">{escaped(value)}</td>'
        + "".join(f'<td style="{CELL}">{each}</td>' for each in drawn)
        + "</tr>"
        for name, value, *drawn in rows
    )
    return (
        '<div class="surefix" style="display:flex;flex-wrap:wrap;gap:8px 24px">'
        f"<div><strong>surefix.{escaped(title)}</strong>"
        f'<table style="border:0;margin:4px 0"><tbody>{cells}</tbody></table></div>'
        f"<div>{drawing}</div></div>"
    )
