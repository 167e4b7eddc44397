"""The pictures of a study, each for light and for dark paper."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from surefix import Evaluation
from surefix._words import plural
from surefix.plot.bars import Band, auc_intervals, false_positives, route_strip, trust_table
from surefix.plot.curves import precision_recall
from surefix.plot.images import Example, Image, examples, examples_height
from surefix.plot.matrix import Window, busiest_window, distance_matrix
from surefix.plot.outcome import longest_gap
from surefix.plot.theme import LOOKS, Theme
from surefix.report.page import Picture, drawn
from surefix.study import UPTO, Study

__all__ = [
    "MISTAKES",
    "Images",
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
SQUARE = (5.4, 5.9)


def curves(
    study: Study, trusted: tuple[float, float] | None = None, trusted_name: str = ""
) -> list[Picture]:
    """The precision-recall curves, in the fewest pictures whose lines can be told apart; optionally
    with a star at the recall and precision of the trusted fixes.
    """
    # The boldest is the shown method, the second the plain sequence: both in every picture.
    always = {result.name: result.curve for result in (study.shown, study.baseline)}
    others = {result.name: result.curve for result in study.results if result.name not in always}
    count = max(1, -(-len(others) // (LOOKS - len(always))))
    rows = len(always) + -(-len(others) // count) + (trusted is not None)
    star: Any = {"trusted": trusted, "trusted_name": trusted_name}

    def picture(named: Mapping[str, Evaluation]) -> Picture:
        areas = ", ".join(f"{name} {curve.auc(UPTO):.2f}" for name, curve in named.items())
        return drawn(
            lambda ax, theme: precision_recall(
                ax, named, upto=UPTO, recall=study.recall, theme=theme, **star
            ),
            (7.4, 4.4 + 0.22 * rows),
            f"Precision-recall curves. Area under the curve up to recall {UPTO:g}: {areas}.",
        )

    return [
        picture(always | {name: others[name] for name in list(others)[part::count]})
        for part in range(count)
    ]


def intervals(study: Study) -> Picture:
    """How sure the areas are."""
    estimates = {result.name: result.area for result in study.results}
    text = ", ".join(
        f"{name} {area:.2f} ({low:.2f} to {high:.2f})"
        for name, (area, low, high) in estimates.items()
    )
    return drawn(
        lambda ax, theme: auc_intervals(
            ax, estimates, upto=UPTO, baseline=study.baseline.name, theme=theme
        ),
        (6.4, 1.2 + 0.34 * len(estimates)),
        f"Areas under the curve up to recall {UPTO:g} with their 95 % intervals: {text}.",
    )


def false(study: Study) -> Picture:
    """The wrong matches accepted by recall 0.2."""
    counts = {result.name: result.curve.false_positives_at(UPTO) for result in study.results}
    text = ", ".join(
        f"{name} {'never there' if count is None else count}" for name, count in counts.items()
    )
    return drawn(
        lambda ax, theme: false_positives(ax, counts, recall=UPTO, theme=theme),
        (6.4, 1.2 + 0.34 * len(counts)),
        f"Wrong matches accepted by recall {UPTO:g}: {text}.",
    )


def trust(study: Study) -> Picture:
    """The confusion table of the trust flag."""
    t = study.trust
    return drawn(
        lambda ax, theme: trust_table(ax, t, theme=theme),
        (8.0, 3.0),
        f"Trusted and right {t.true_positives}, trusted and wrong {t.false_positives}, not trusted "
        f"and right {t.false_negatives}, not trusted and wrong {t.true_negatives}.",
    )


def matrix(study: Study, label: str = "distance", every: bool = False) -> Picture:
    """The whole distance matrix, with the judged matches of the shown method, or every match."""
    n, m = study.distances.shape
    return drawn(
        lambda ax, theme: _matrix(ax, study, label, every, theme, close=False),
        SQUARE,
        f"Distance matrix of {plural(n, 'place')} by {plural(m, 'query', 'queries')}, with the "
        f"match of each by {study.shown.name}.",
        "The stronger the tone, the more alike. The frame marks the close-up.",
        textured=True,
    )


def close_up(study: Study, label: str = "distance", every: bool = False) -> Picture:
    """The part of the matrix with the rarest outcomes."""
    (query, width), (place, height) = _window(study)
    return drawn(
        lambda ax, theme: _matrix(ax, study, label, every, theme, close=True),
        SQUARE,
        f"Close-up of the matrix, from query {query} and place {place} on: "
        f"{plural(width, 'query', 'queries')}, {plural(height, 'place')}.",
        "The close-up. The line is the true path; matches that fall outside the frame are not "
        "seen here.",
    )


def _matrix(ax: Axes, study: Study, label: str, every: bool, theme: Theme, *, close: bool) -> None:
    queries, places = _window(study)
    shown = study.shown
    distance_matrix(
        ax,
        study.distances,
        shown.matches.place,
        study.run.trusted,
        shown.right,
        truth=study.true_place,
        judged=None if every else shown.judged,
        queries=queries if close else None,
        places=places if close else None,
        outline=None if close else (queries, places),
        label=label,
        theme=theme,
    )


def _window(study: Study) -> tuple[Window, Window]:
    shown = study.shown
    count = max(12, min(44, len(study) // 6))
    return busiest_window(
        shown.matches.place, study.run.trusted, shown.right, study.true_place, count=count
    )


def strip(
    study: Study, along: NDArray[np.float64] | None = None, trusted: Band | None = None
) -> Picture:
    """The route, with a band for each method, right and wrong, and one of the trusted matches: by
    default the single ones. With ``trusted``, every match is shown, not only those that were
    judged. The bracket is the longest stretch without a trusted and right one.
    """
    all_ = np.ones(len(study), np.bool_)
    bands: list[Band] = [
        (result.name, result.right, all_ if trusted else result.judged & result.accepted)
        for result in study.results
    ]
    judged = study.run.trusted & study.single_judged
    bands.append(trusted or ("trusted single matches", study.single_right, judged))
    positions = np.arange(len(study), dtype=np.float64) if along is None else along
    gap = longest_gap(bands[-1][1] & bands[-1][2])
    if along is None:
        ends, named = (gap.start - 0.5, gap.stop - 0.5), ("query", "queries")
    else:
        ends = float(along[max(gap.start - 1, 0)]), float(along[min(gap.stop, len(along) - 1)])
        named = ("way along the drive (m)", "m")
    return drawn(
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
        "A band for each method along the route: up if its matches are right, down if they are "
        "wrong.",
    )


def mistakes(study: Study, queries: Images, references: Images) -> Picture | None:
    """The wrong matches of the shown method with the best scores, as images; None without any."""
    place = study.shown.matches.place
    chosen = [(query, int(place[query])) for query in study.mistakes(MISTAKES)]
    title = f"Wrong matches of {study.shown.name}, the best scores first"
    return _side_by_side(study, chosen, queries, references, title)


def trusted_mistakes(study: Study, queries: Images, references: Images) -> Picture | None:
    """Single matches that are trusted and wrong, as images; None without any."""
    place = study.run.single_place
    chosen = [(query, int(place[query])) for query in study.trusted_mistakes(MISTAKES)]
    title = "Single matches that are trusted and wrong, the nearest first"
    return _side_by_side(study, chosen, queries, references, title)


def _side_by_side(
    study: Study, chosen: Sequence[tuple[int, int]], queries: Images, references: Images, title: str
) -> Picture | None:
    if not chosen or (queries is None and references is None):
        return None
    shown = [_example(study, query, place, queries, references) for query, place in chosen]
    across = min(2, len(shown))
    width = 11.0 if across == 2 else 5.6
    captions = "; ".join(f"{example.images[0][0]}: {example.caption}" for example in shown)
    return drawn(
        lambda ax, theme: examples(ax, shown, across=across, theme=theme),
        (width, examples_height(shown, width - 0.2, across=across) + 0.2),
        f"{title}: the query, the place it was matched to, and its true place. {captions}.",
        f"{title}.",
        textured=True,
    )


def _example(study: Study, query: int, place: int, queries: Images, references: Images) -> Example:
    true = int(study.true_place[query])
    images = [
        (f"query {query}", None if queries is None else queries[query]),
        (f"matched to place {place}", None if references is None else references[place]),
    ]
    if true >= 0:
        images.append((f"true place {true}", None if references is None else references[true]))
    trusted = "trusted" if study.run.trusted[query] else "not trusted"
    return Example(images, f"{study.off(query, place)}, {trusted}")
