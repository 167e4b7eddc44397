"""The pictures of a drive, each on light and on dark paper."""

import io
from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.image import imsave

from surefix.plot.bars import route_strip
from surefix.plot.curves import precision_recall
from surefix.plot.images import Column, Image, Pair, montage, montage_height, spread
from surefix.plot.matrix import busiest_window, distance_matrix
from surefix.plot.outcome import Outcome
from surefix.plot.theme import DARK, LIGHT, Theme, png
from surefix.report.drive import Drive
from surefix.report.page import Picture

__all__ = ["close_up", "curves", "matrix", "pairs", "photograph", "strip"]

PAIRS = 3


def matrix(drive: Drive) -> Picture:
    """The whole distance matrix."""
    counts = ", ".join(f"{count} {outcome.value}" for outcome, count in drive.counts.items())
    return _picture(
        lambda ax, theme: _matrix(ax, drive, theme, close=False),
        (5.4, 5.9),
        f"Distance matrix of {len(drive.distances)} places by {len(drive.run)} queries, with the match of "
        f"each: {counts}.",
        "The stronger the tone, the more alike. The frame marks the close-up.",
        textured=True,
    )


def close_up(drive: Drive) -> Picture:
    """The part of the matrix where the rarest outcomes are."""
    (query, width), (place, height) = _window(drive)
    return _picture(
        lambda ax, theme: _matrix(ax, drive, theme, close=True),
        (5.4, 5.9),
        f"Close-up of the matrix, from query {query} and place {place} on: {width} queries, {height} places.",
        "The close-up. The line is the true path; matches that fall outside the frame are not seen here.",
    )


def curves(drive: Drive) -> Picture:
    """The precision-recall curves of the weighted sequence and of the baseline."""
    named = {"weighted sequence": drive.weighted_curve, "unweighted sequence": drive.baseline_curve}
    areas = ", ".join(f"{name} {curve.auc(0.2):.2f}" for name, curve in named.items())
    return _picture(
        lambda ax, theme: precision_recall(
            ax, named, trusted=drive.trusted_point, trusted_name=drive.trusted_name, theme=theme
        ),
        (7.4, 5.0),
        f"Precision-recall curves. Area under the curve up to recall 0.2: {areas}.",
    )


def strip(drive: Drive) -> Picture:
    """Where along the route the matches were right."""
    everywhere = np.ones(len(drive.run), np.bool_)
    bands = (
        ("Unweighted sequence, every fix", drive.baseline_right, everywhere),
        ("Weighted sequence, every fix", drive.right, everywhere),
        ("Weighted sequence, trusted fixes only", drive.right, drive.run.trusted),
    )
    gap = drive.gap_metres if len(drive.gap) > 0 else None
    return _picture(
        lambda ax, theme: route_strip(ax, drive.revisit.positions, bands, gap=gap, theme=theme),
        (11, 4.3),
        "Three bands along the route: where the unweighted sequence, the weighted sequence, and its trusted "
        "fixes alone were right and wrong.",
        wide=True,
    )


def pairs(drive: Drive) -> Picture:
    """Queries and the places they were matched to, by outcome."""
    columns = [
        Column(
            outcome,
            drive.counts[outcome],
            [_pair(drive, query) for query in spread(np.flatnonzero(drive.masks[outcome]), PAIRS)],
        )
        for outcome in Outcome
    ]
    rows = max(len(column.pairs) for column in columns)
    return _picture(
        lambda ax, theme: montage(ax, columns, rows=rows, theme=theme),
        (11, montage_height(drive.size, 10.8, columns=len(columns), rows=rows) + 0.2),
        "Pairs of images, a column for each outcome: the query above, the place it was matched to below.",
        wide=True,
        textured=True,
    )


def photograph(image: Image, alt: str, caption: str) -> Picture:
    """A camera image as it is, the same on any paper."""
    file = io.BytesIO()
    imsave(file, image, format="png")
    return Picture(file.getvalue(), file.getvalue(), alt, caption, textured=True)


def _picture(
    draw: Callable[[Axes, Theme], object],
    size: tuple[float, float],
    alt: str,
    caption: str = "",
    *,
    wide: bool = False,
    textured: bool = False,
) -> Picture:
    return Picture(png(draw, size, LIGHT), png(draw, size, DARK), alt, caption, wide, textured)


def _matrix(ax: Axes, drive: Drive, theme: Theme, *, close: bool) -> None:
    queries, places = _window(drive)
    distance_matrix(
        ax,
        drive.distances,
        drive.run.place,
        drive.run.trusted,
        drive.right,
        truth=drive.truth,
        queries=queries if close else None,
        places=places if close else None,
        outline=None if close else (queries, places),
        label="distance (mean difference, in standard deviations of a patch)",
        theme=theme,
    )


def _window(drive: Drive) -> tuple[tuple[int, int], tuple[int, int]]:
    count = max(12, min(44, len(drive.run) // 6))
    return busiest_window(drive.run.place, drive.run.trusted, drive.right, drive.truth, count=count)


def _pair(drive: Drive, query: int) -> Pair:
    place = int(drive.run.place[query])
    caption = f"frame {query} to place {place}\n{drive.metres_off[query]:.0f} m off"
    return Pair(drive.revisit[query], drive.reference[place], caption)
