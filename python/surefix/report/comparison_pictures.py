"""The pictures of a comparison, each on light and on dark paper."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from surefix import Evaluation
from surefix._words import counted
from surefix.plot.bars import auc_intervals, false_positives, route_strip, trust_table
from surefix.plot.curves import precision_recall
from surefix.plot.images import Example, Image, examples, examples_height
from surefix.plot.matrix import busiest_window, distance_matrix
from surefix.plot.outcome import longest_gap
from surefix.plot.theme import DARK, LIGHT, LOOKS, Theme, png
from surefix.report.comparison import UPTO, Comparison
from surefix.report.page import Picture

__all__ = [
    "close_up",
    "curves",
    "false",
    "intervals",
    "matrix",
    "mistakes",
    "strip",
    "trust",
    "trusted_mistakes",
]

# By their numbers; those of the mistakes are enough.
Images = Sequence[Image] | Mapping[int, Image] | None

MISTAKES = 6


def curves(comparison: Comparison) -> list[Picture]:
    """The precision-recall curves: all in one picture, or in as many as it takes to tell them
    apart.
    """
    # The boldest is the method that the other pictures are of, the second the plain sequence: both
    # in every picture.
    always = {result.name: result.curve for result in (comparison.shown, comparison.baseline)}
    others = {
        result.name: result.curve for result in comparison.results if result.name not in always
    }
    count = max(1, -(-len(others) // (LOOKS - len(always))))
    rows = len(always) + -(-len(others) // count)
    pictures = []
    for part in range(count):
        named = always | {name: others[name] for name in list(others)[part::count]}
        areas = ", ".join(f"{name} {curve.auc(UPTO):.2f}" for name, curve in named.items())
        text = f"Precision-recall curves. Area under the curve up to recall {UPTO:g}: {areas}."
        draw = partial(_curves, curves=named, recall=comparison.recall)
        pictures.append(_picture(draw, (7.4, 4.4 + 0.22 * rows), text))
    return pictures


def intervals(comparison: Comparison) -> Picture:
    """How sure the areas are."""
    estimates = {result.name: result.area for result in comparison.results}
    text = ", ".join(
        f"{name} {area:.2f} ({low:.2f} to {high:.2f})"
        for name, (area, low, high) in estimates.items()
    )
    return _picture(
        lambda ax, theme: auc_intervals(
            ax, estimates, upto=UPTO, baseline=comparison.baseline.name, theme=theme
        ),
        (6.4, 1.2 + 0.34 * len(estimates)),
        f"Areas under the curve up to recall {UPTO:g} with their 95 % intervals: {text}.",
    )


def false(comparison: Comparison) -> Picture:
    """The wrong matches accepted by recall 0.2."""
    counts = {result.name: result.curve.false_positives_at(UPTO) for result in comparison.results}
    text = ", ".join(
        f"{name} {'never there' if count is None else count}" for name, count in counts.items()
    )
    return _picture(
        lambda ax, theme: false_positives(ax, counts, recall=UPTO, theme=theme),
        (6.4, 1.2 + 0.34 * len(counts)),
        f"Wrong matches accepted by recall {UPTO:g}: {text}.",
    )


def trust(comparison: Comparison) -> Picture:
    """The confusion table of the trust flag."""
    t = comparison.trust
    return _picture(
        lambda ax, theme: trust_table(ax, t, theme=theme),
        (8.2, 3.0),
        f"Trusted and right {t.true_positives}, trusted and wrong {t.false_positives}, not trusted and right "
        f"{t.false_negatives}, not trusted and wrong {t.true_negatives}.",
    )


def matrix(comparison: Comparison) -> Picture:
    """The whole distance matrix, with the matches of the shown method."""
    n, m = comparison.distances.shape
    return _picture(
        lambda ax, theme: _matrix(ax, comparison, theme, close=False),
        (5.4, 5.9),
        f"Distance matrix of {counted(n, 'place')} by {counted(m, 'query', 'queries')}, with the match of each by "
        f"{comparison.shown.name}.",
        "The stronger the tone, the more alike. The frame marks the close-up.",
        textured=True,
    )


def close_up(comparison: Comparison) -> Picture:
    """The part of the matrix where the rarest outcomes are."""
    (query, width), (place, height) = _window(comparison)
    return _picture(
        lambda ax, theme: _matrix(ax, comparison, theme, close=True),
        (5.4, 5.9),
        f"Close-up of the matrix, from query {query} and place {place} on: "
        f"{counted(width, 'query', 'queries')}, {counted(height, 'place')}.",
        "The close-up. The line is the true path; matches that fall outside the frame are not seen here.",
    )


def strip(comparison: Comparison, along: NDArray[np.float64] | None) -> Picture:
    """Where along the route each method is right and wrong."""
    bands = [
        (result.name, result.right, result.judged & result.accepted)
        for result in comparison.results
    ]
    judged = comparison.single_judged
    bands.append(
        ("trusted single matches", comparison.single_right, comparison.run.trusted & judged)
    )
    positions = np.arange(len(comparison), dtype=np.float64) if along is None else along
    gap = longest_gap(bands[-1][1] & bands[-1][2])
    if along is None:
        ends, named = (gap.start - 0.5, gap.stop - 0.5), ("query", "queries")
    else:
        ends = float(along[max(gap.start - 1, 0)]), float(along[min(gap.stop, len(along) - 1)])
        named = ("way along the drive (m)", "m")
    return _picture(
        lambda ax, theme: route_strip(
            ax,
            positions,
            bands,
            gap=ends if ends[1] > ends[0] else None,
            along=named[0],
            unit=named[1],
            theme=theme,
        ),
        (11, 0.8 + 1.05 * len(bands)),
        "A band for each method along the route: up where its matches are right, down where they are wrong.",
        wide=True,
    )


def mistakes(comparison: Comparison, queries: Images, references: Images) -> Picture | None:
    """The wrong matches of the shown method with the best scores, as images; None without any."""
    shown = comparison.shown.matches
    chosen = [(query, int(shown.place[query])) for query in comparison.mistakes(MISTAKES)]
    return _side_by_side(
        comparison,
        chosen,
        queries,
        references,
        f"Wrong matches of {comparison.shown.name}, the best scores first",
    )


def trusted_mistakes(comparison: Comparison, queries: Images, references: Images) -> Picture | None:
    """Single matches that are trusted and wrong, as images; None without any."""
    single = comparison.run.single_place
    chosen = [(query, int(single[query])) for query in comparison.trusted_mistakes(MISTAKES)]
    return _side_by_side(
        comparison,
        chosen,
        queries,
        references,
        "Single matches that are trusted and wrong, the nearest first",
    )


def _side_by_side(
    comparison: Comparison,
    chosen: Sequence[tuple[int, int]],
    queries: Images,
    references: Images,
    what: str,
) -> Picture | None:
    if not chosen or (queries is None and references is None):
        return None
    shown = [_example(comparison, query, place, queries, references) for query, place in chosen]
    across = min(2, len(shown))
    width = 11.0 if across == 2 else 5.6
    return _picture(
        lambda ax, theme: examples(ax, shown, across=across, theme=theme),
        (width, examples_height(shown, width - 0.2, across=across) + 0.2),
        f"{what}: the query, the place it was matched to, and its true place. "
        + "; ".join(f"{example.images[0][0]}: {example.caption}" for example in shown)
        + ".",
        f"{what}.",
        wide=across == 2,
        textured=True,
    )


def _example(
    comparison: Comparison, query: int, place: int, queries: Images, references: Images
) -> Example:
    true = int(comparison.true_place[query])
    images = [
        (f"query {query}", None if queries is None else queries[query]),
        (f"matched to place {place}", None if references is None else references[place]),
    ]
    if true >= 0:
        images.append((f"true place {true}", None if references is None else references[true]))
    trusted = "trusted" if comparison.run.trusted[query] else "not trusted"
    return Example(images, f"{comparison.off(query, place)}, {trusted}")


def _curves(ax: Axes, theme: Theme, *, curves: Mapping[str, Evaluation], recall: str) -> Axes:
    return precision_recall(ax, curves, upto=UPTO, recall=recall, theme=theme)


def _matrix(ax: Axes, comparison: Comparison, theme: Theme, *, close: bool) -> None:
    queries, places = _window(comparison)
    shown = comparison.shown
    distance_matrix(
        ax,
        comparison.distances,
        shown.matches.place,
        comparison.run.trusted,
        shown.right,
        truth=comparison.true_place,
        judged=shown.judged,
        queries=queries if close else None,
        places=places if close else None,
        outline=None if close else (queries, places),
        theme=theme,
    )


def _window(comparison: Comparison) -> tuple[tuple[int, int], tuple[int, int]]:
    shown = comparison.shown
    count = max(12, min(44, len(comparison) // 6))
    return busiest_window(
        shown.matches.place, comparison.run.trusted, shown.right, comparison.true_place, count=count
    )


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
