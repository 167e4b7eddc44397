"""The distance matrix as a picture, with the match of each query on it."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.transforms import ScaledTranslation
from numpy.typing import NDArray

from surefix.plot.axes import end_at_tick, on_axes
from surefix.plot.bars import spans
from surefix.plot.outcome import Outcome, outcomes
from surefix.plot.theme import LIGHT, MARKS, Theme

__all__ = ["Window", "aligned_track", "busiest_window", "distance_matrix"]

Window = tuple[int, int]
"""The first of some consecutive places or queries, and their number."""

# Nine of ten distances are nearly alike; the tones are spent on the near ones.
TONES = (0.1, 60.0)

ENOUGH = 8
# From the lowest up: the rare and the trusted on top.
LAYERS = [
    Outcome.UNTRUSTED_WRONG,
    Outcome.UNTRUSTED_RIGHT,
    Outcome.TRUSTED_RIGHT,
    Outcome.TRUSTED_WRONG,
]
# The most breaks that are drawn.
LINES = 100
# The height of an axis's numbers and words, in inches.
WORDS = 0.5

LEGEND: Any = {
    "loc": "lower center",
    "bbox_to_anchor": (0.5, 1.0),
    "ncols": 2,
    "handletextpad": 0.4,
    "columnspacing": 1.6,
}


@on_axes(6.4, 6.9)
def distance_matrix(
    distances: NDArray[np.float32],
    place: NDArray[np.int64],
    trusted: NDArray[np.bool_],
    right: NDArray[np.bool_] | None = None,
    *,
    truth: NDArray[np.int64] | None = None,
    judged: NDArray[np.bool_] | None = None,
    queries: Window | None = None,
    places: Window | None = None,
    outline: tuple[Window, Window] | None = None,
    covers: tuple[Window, Window] | None = None,
    breaks: NDArray[np.int64] | Sequence[int] = (),
    label: str = "distance",
    ax: Axes | None = None,
    theme: Theme = LIGHT,
) -> Axes:
    """Draws the distances, dark if a query looks like a place, and the match of each query.

    Parameters
    ----------
    distances : array of float32, shape (n, m)
        ``distances[i, j]`` is the distance between place ``i`` and query ``j``.
    place, trusted : arrays, shape (m,)
        The matches, as of a ``surefix.Run``.
    right : array of bool, shape (m,), optional
        Which of them are right, as of ``is_right``. Without it the marks say trusted or not.
    truth : array of int, shape (m,), optional
        The true place of each query, -1 off the map: the true path, a line in a
        close-up.
    judged : array of bool, shape (m,), optional
        False for queries of which the truth is not known: their matches are not drawn. All by
        default.
    queries, places : (first, count), optional
        A close-up of these rather than the whole matrix, with larger marks and a line for the true
        path.
    outline : (queries, places), optional
        Draws a frame around these: the part of a close-up.
    covers : (queries, places), optional
        The queries and places that ``distances`` covers, if it is a part of a matrix or a thinned
        one. By default it is whole.
    breaks : sequence of int, optional
        The places at which a segment begins: a thin line before each.
    label : str
        The distances and their unit, for the scale of a close-up.
    ax : Axes, optional
        Where to draw; by default a new figure.
    """
    assert ax is not None
    close = queries is not None or places is not None
    whole = (0, len(place)), (0, distances.shape[0] if covers is None else sum(covers[1]))
    first_query, query_count = queries or whole[0]
    first_place, place_count = places or whole[1]
    cell = 0.5
    covers = covers or ((0, distances.shape[1]), (0, distances.shape[0]))
    inner = [at for at in breaks if first_place < at < first_place + place_count]
    _lines(ax, inner, theme)
    tones = _tones(ax, distances, theme, (query_count, place_count), covers, close)
    shown = np.arange(len(place))
    seen = np.ones(len(place), np.bool_) if judged is None else judged
    inside = seen & (shown >= first_query) & (shown < first_query + query_count)
    inside &= (place >= first_place) & (place < first_place + place_count)
    figure = ax.get_figure(root=True)
    known = right is not None
    masks = outcomes(np.ones(len(place), np.bool_) if right is None else right, trusted)
    drawn = [outcome for outcome in Outcome if known or outcome.right]
    colours = {outcome: _colour(outcome, known, theme) for outcome in drawn}
    growth = np.clip(220 / max(query_count, place_count), 0.6, 5.0) if close else 1.0
    for layer, outcome in enumerate(sorted(drawn, key=LAYERS.index)):
        mark, colour = MARKS[outcome], colours[outcome]
        at = np.flatnonzero(masks[outcome] & inside)
        # Rings are all edge, thin crosses have none, filled marks are set off from the tones.
        paint: Any = {"color": colour}
        if mark.hollow:
            paint = {"facecolors": "none", "edgecolors": colour}
        elif mark.shape != "x":
            paint["edgecolors"] = theme.paper
        width = mark.width * np.sqrt(growth)
        if mark.hollow or mark.shape == "x":
            # Thin lines are lost on dark tones.
            halo = width + (1.4 if close else 0.8)
            paint["path_effects"] = [withStroke(linewidth=halo, foreground=theme.paper)]
        ax.scatter(
            at,
            place[at],
            s=mark.size * growth,
            marker=mark.shape,
            zorder=3 + layer,
            clip_on=False,
            linewidths=width,
            **paint,
        )
    if close:
        if truth is not None:
            ax.plot(*_path(truth), color=theme.truth, linewidth=1.0, zorder=2)
        if figure is not None:
            shape: Any = {"location": "top", "shrink": 0.6, "aspect": 32, "pad": 0.02}
            bar = figure.colorbar(tones, ax=ax, extend="both", **shape)
            bar.set_label(label)
            bar.outline.set_visible(False)
    if outline is not None:
        (x, width), (y, height) = outline
        corner = x - cell, y - cell
        style: Any = {"edgecolor": theme.ink, "linewidth": 1.1, "zorder": 10}
        ax.add_patch(Rectangle(corner, width, height, fill=False, **style))
    _axes(ax, (first_query, query_count), (first_place, place_count))
    counted = inside if close else seen
    entries = [
        _entry(outcome, colours[outcome], int((masks[outcome] & counted).sum()), known, theme)
        for outcome in drawn
    ]
    if close and truth is not None:
        entries.append(Line2D([], [], color=theme.truth, linewidth=1.0, label="true path"))
    place_of: dict[str, Any] = {"ncols": 2 if len(entries) < 5 else 3}
    if close and figure is not None:
        # Above a close-up is its scale; so below, where the axis has its words.
        below = ScaledTranslation(0, -WORDS, figure.dpi_scale_trans)
        place_of |= {"loc": "upper center", "bbox_transform": ax.transAxes + below}
        place_of["bbox_to_anchor"] = (0.5, 0.0)
    ax.legend(handles=entries, **(LEGEND | place_of))
    return ax


@on_axes(6.4, 6.6)
def aligned_track(
    distances: NDArray[np.float32],
    place: NDArray[np.int64],
    confidence: NDArray[np.float64],
    off_map: NDArray[np.float64],
    *,
    places: int | None = None,
    least: float = 0.5,
    breaks: NDArray[np.int64] | Sequence[int] = (),
    ax: Axes | None = None,
    theme: Theme = LIGHT,
) -> Axes:
    """Draws the distances, and the place of each query by an alignment over them; the stretches in
    which it is not sure are shaded.

    Parameters
    ----------
    distances : array of float32, shape (n, m)
        Or, of a long drive, a thinned matrix: each row of as many places, each column of as many
        queries as the others, the last ones of fewer.
    place, confidence, off_map : arrays, shape (m,)
        As of a ``surefix.Alignment``.
    places : int
        The number of places of the map; by default that of the rows.
    least : float
        A query of a lower confidence is doubtful. It is off the map if ``off_map`` is 0.5 or more.
    breaks : sequence of int, optional
        The places at which a segment begins: a thin line before each.
    ax : Axes, optional
        Where to draw; by default a new figure.
    """
    assert ax is not None
    _lines(ax, breaks, theme)
    count = (len(place), len(distances) if places is None else places)
    # As much as the rows and the columns cover.
    rows, columns = distances.shape
    covers = (0, columns * -(-count[0] // columns)), (0, rows * -(-count[1] // rows))
    _tones(ax, distances, theme, count, covers)
    doubtful, off = confidence < least, off_map >= 0.5
    edges = np.arange(len(place) + 1, dtype=np.float64) - 0.5
    for mask, colour in ((doubtful & ~off, theme.trusted_wrong), (off, theme.muted)):
        for start, width in spans(edges, mask):
            ax.axvspan(start, start + width, color=colour, alpha=0.22, linewidth=0, zorder=2)
    entries = []
    for name, mask, colour in (
        ("sure", ~doubtful & ~off, theme.trusted_right),
        ("doubtful", doubtful & ~off, theme.trusted_wrong),
        ("probably off the map", off, theme.muted),
    ):
        at = np.flatnonzero(mask)
        # Where it would be if it were on the map, says nothing.
        shown = at if name != "probably off the map" else at[:0]
        ax.scatter(shown, place[shown], s=5, color=colour, linewidths=0, zorder=3)
        entries.append(Line2D([], [], linestyle="none", marker="o", markersize=5, color=colour))
        entries[-1].set_label(f"{name} ({len(at)})")
    _axes(ax, (0, count[0]), (0, count[1]))
    ax.legend(handles=entries, **(LEGEND | {"ncols": 3}))
    return ax


def _lines(ax: Axes, breaks: NDArray[np.int64] | Sequence[int], theme: Theme) -> None:
    """A thin line before each of these places, unless their number would hide the rest."""
    for place in breaks if len(breaks) <= LINES else ():
        ax.axhline(place - 0.5, color=theme.ink, linewidth=0.6, zorder=2)


def _tones(
    ax: Axes,
    distances: NDArray[np.float32],
    theme: Theme,
    counts: tuple[int, int],
    covers: tuple[Window, Window],
    close: bool = False,
) -> AxesImage:
    """The distances as tones: of the queries and places ``covers``, as many as ``counts`` (queries,
    places) are seen.
    """
    nearest, furthest = np.percentile(distances, TONES)
    if furthest <= nearest:
        furthest = nearest + 1.0
    queries, places = counts
    (left, width), (low, height) = covers
    return ax.imshow(
        distances,
        cmap=theme.distance_map,
        vmin=float(nearest),
        vmax=float(furthest),
        origin="lower",
        extent=(left - 0.5, left + width - 0.5, low - 0.5, low + height - 0.5),
        # A square cell says that queries and places are counted alike, if there is room for it.
        aspect="equal" if 1 / 3 < queries / places < 3 else "auto",
        interpolation="nearest" if close else "antialiased",
    )


def _path(truth: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The line along the true places, which ends off the map and where the drive jumps."""
    steps = np.abs(np.diff(truth))
    usual = int(np.median(steps)) if len(steps) else 0
    jumps = np.flatnonzero(steps > 10 + 5 * usual) + 1
    queries = np.insert(np.arange(len(truth), dtype=np.float64), jumps, np.nan)
    return queries, np.insert(np.where(truth >= 0, truth, np.nan), jumps, np.nan)


def _axes(ax: Axes, queries: Window, places: Window) -> None:
    end_at_tick(ax.xaxis, queries[0] - 0.5, sum(queries) - 0.5)
    end_at_tick(ax.yaxis, places[0] - 0.5, sum(places) - 0.5)
    ax.set_xlabel("query (frame of the second drive)")
    ax.set_ylabel("place (frame of the map)")


def busiest_window(
    place: NDArray[np.int64],
    trusted: NDArray[np.bool_],
    right: NDArray[np.bool_],
    truth: NDArray[np.int64],
    *,
    count: int = 60,
) -> tuple[Window, Window]:
    """The square on the true path that shows rare outcomes best: (queries, places), each ``count``
    long.

    Matches inside the square count, up to ``ENOUGH`` of each outcome: one outcome alone does not
    win.
    """
    m, n = len(place), int(max(place.max(), truth.max())) + 1
    side = min(count, m, n)
    masks = outcomes(right, trusted)
    best, window = -1, ((0, side), (0, side))
    for start in range(0, m - side + 1, max(1, side // 10)):
        path = truth[start : start + side]
        middle = int(np.median(path[path >= 0])) if (path >= 0).any() else 0
        low = int(np.clip(middle - side // 2, 0, n - side))
        inside = np.zeros(m, np.bool_)
        inside[start : start + side] = True
        inside &= (place >= low) & (place < low + side)
        worth = sum(min(ENOUGH, int((mask & inside).sum())) for mask in masks.values())
        if worth > best:
            best, window = worth, ((start, side), (low, side))
    return window


def _colour(outcome: Outcome, known: bool, theme: Theme) -> str:
    """Of a mark; if the truth is not known, of trust alone."""
    if known:
        return theme.colour(outcome)
    return theme.trusted if outcome.trusted else theme.untrusted


def _entry(outcome: Outcome, colour: str, count: int, known: bool, theme: Theme) -> Line2D:
    """Of the legend."""
    mark = MARKS[outcome]
    name = outcome.value if known else outcome.value.partition(",")[0]
    edge, width = (theme.paper, 0.6) if mark.shape == "X" else (colour, 1.2)
    return Line2D(
        [],
        [],
        linestyle="none",
        marker=mark.shape,
        markersize=8 if outcome is Outcome.TRUSTED_WRONG else 6,
        markerfacecolor="none" if mark.hollow else colour,
        markeredgecolor=edge,
        markeredgewidth=width,
        label=f"{name} ({count})",
    )
