"""The pictures of a study, each for light and for dark paper."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from surefix import Evaluation
from surefix._words import place_in, plural
from surefix.plot.bars import Band, auc_intervals, false_positives, route_strip, trust_table
from surefix.plot.curves import precision_recall
from surefix.plot.curves import reliability as plot_reliability
from surefix.plot.images import Example, Image, examples, examples_height
from surefix.plot.matrix import busiest_window, distance_matrix
from surefix.plot.outcome import longest_gap
from surefix.plot.theme import LOOKS
from surefix.report.page import Picture, drawn
from surefix.report.tables import MISTAKES, stem
from surefix.study import SCENARIOS, UPTO, Result, Study
from surefix.study.scenarios import RECORDED

__all__ = [
    "MISTAKES",
    "Images",
    "curves",
    "matrix",
    "mistakes",
    "numbers",
    "reliability",
    "strip",
    "trust",
]

# By their numbers; those of the mistakes are enough.
Images = Sequence[Image] | Mapping[int, Image] | None


def curves(
    study: Study, trusted: tuple[float, float] | None = None, trusted_name: str = ""
) -> dict[str, Picture]:
    """The precision-recall curves by the names of their files, in the fewest pictures whose
    lines can be told apart; optionally with a star at the recall and precision of the trusted
    fixes.
    """
    # The boldest is the shown method, the second the plain sequence: both in every picture.
    always = {result.name: result.curve for result in (study.shown, study.baseline)}
    others = {result.name: result.curve for result in study.results if result.name not in always}
    count = max(1, -(-len(others) // (LOOKS - len(always))))
    rows = len(always) + -(-len(others) // count) + (trusted is not None)

    def picture(named: Mapping[str, Evaluation]) -> Picture:
        areas = ", ".join(f"{name} {curve.auc(UPTO):.2f}" for name, curve in named.items())
        return drawn(
            (7.4, 4.4 + 0.22 * rows),
            f"Precision-recall curves. Area under the curve up to recall {UPTO:g}: {areas}.",
            precision_recall,
            named,
            upto=UPTO,
            recall=study.recall,
            trusted=trusted,
            trusted_name=trusted_name,
        )

    names = ["precision_recall.png", *(f"precision_recall_{k}.png" for k in range(2, count + 1))]
    return {
        name: picture(always | {other: others[other] for other in list(others)[part::count]})
        for part, name in enumerate(names)
    }


def numbers(study: Study) -> dict[str, Picture]:
    """The areas with their intervals, and the wrong matches accepted by recall 0.2."""
    estimates = {result.name: result.area for result in study.results}
    text = ", ".join(
        f"{name} {area:.2f} ({low:.2f} to {high:.2f})"
        for name, (area, low, high) in estimates.items()
    )
    size = 6.4, 1.2 + 0.34 * len(estimates)
    alt = f"Areas under the curve up to recall {UPTO:g} with their 95 % intervals: {text}."
    first = study.baseline.name
    areas = drawn(size, alt, auc_intervals, estimates, upto=UPTO, baseline=first)
    counts = {result.name: result.curve.false_positives_at(UPTO) for result in study.results}
    text = ", ".join(
        f"{name} {'never there' if count is None else count}" for name, count in counts.items()
    )
    alt = f"Wrong matches accepted by recall {UPTO:g}: {text}."
    bars = drawn(size, alt, false_positives, counts, recall=UPTO)
    return {"auc.png": areas, "false_positives.png": bars}


def reliability(studies: Sequence[Study]) -> dict[str, Picture]:
    """A reliability diagram for each drive on which a method says a confidence."""
    pictures = {}
    for study in studies:
        said = {r.name: r.reliability for r in study.results if r.reliability is not None}
        if not said:
            continue
        errors = ", ".join(f"{name} off by {each.error:.2f}" for name, each in said.items())
        name = "" if study.scenario == RECORDED else f"_{stem(study)}"
        pictures[f"reliability{name}.png"] = drawn(
            (5.4, 4.7 + 0.22 * len(said)),
            f"What was said against what was right, {study.scenario}: {errors}.",
            plot_reliability,
            dict(list(said.items())[:LOOKS]),
            caption=f"{study.scenario}: {SCENARIOS[study.scenario].description}",
        )
    return pictures


def trust(study: Study) -> Picture:
    """The confusion table of the trust flag."""
    t = study.trust
    alt = (
        f"Trusted and right {t.true_positives}, trusted and wrong {t.false_positives}, not trusted "
        f"and right {t.false_negatives}, not trusted and wrong {t.true_negatives}."
    )
    return drawn((8.0, 3.0), alt, trust_table, t)


def matrix(
    study: Study, every: bool = False, label: str = "distance", result: Result | None = None
) -> dict[str, Picture]:
    """The whole distance matrix, with the judged matches of a result (by default the shown
    method's) or every match; and the part of it with the rarest outcomes.
    """
    n, m = study.distances.shape
    shown, size = result or study.shown, (5.4, 5.9)
    matches = shown.matches.place, study.run.trusted, shown.right
    window = busiest_window(*matches, study.true_place, count=max(12, min(44, m // 6)))
    judged = None if every else shown.judged
    segments = study.context.segments
    breaks = () if segments is None else segments.breaks
    (all_, covered), (part, covers) = study.seen(), study.seen(*window)
    whole = drawn(
        size,
        f"Distance matrix of {plural(n, 'place')} by {plural(m, 'query', 'queries')}, with the "
        f"match of each by {shown.name}.",
        distance_matrix,
        all_,
        *matches,
        covers=covered,
        judged=judged,
        outline=window,
        caption="The stronger the tone, the more alike. The frame marks the close-up.",
        textured=True,
        breaks=breaks,
    )
    queries, places = window
    close_up = drawn(
        size,
        f"Close-up of the matrix, from query {queries[0]} and place {places[0]} on: "
        f"{plural(queries[1], 'query', 'queries')}, {plural(places[1], 'place')}.",
        distance_matrix,
        part,
        *matches,
        covers=covers,
        truth=study.true_place,
        judged=judged,
        queries=queries,
        places=places,
        breaks=breaks,
        label=label,
        caption="The close-up. The line is the true path; matches that fall outside the frame are "
        "not seen here.",
    )
    return {"distance_matrix.png": whole, "close_up.png": close_up}


def strip(
    study: Study, along: NDArray[np.float64] | None = None, more: Sequence[Band] = ()
) -> Picture:
    """The route, with a band for each method, right and wrong, and ``more``: by default one of the
    trusted single matches. With ``more``, every match is shown, not only those that were judged.
    The bracket is the longest stretch without a right one in the last band.
    """
    all_ = np.ones(len(study), np.bool_)
    bands: list[Band] = [
        (result.name, result.right, all_ if more else result.judged & result.accepted)
        for result in study.results
    ]
    judged = study.run.trusted & study.single_judged
    bands += more or [("trusted single matches", study.single_right, judged)]
    gap = longest_gap(bands[-1][1] & bands[-1][2])
    if along is None:
        positions = np.arange(len(study), dtype=np.float64)
        ends, axis, unit = (gap.start - 0.5, gap.stop - 0.5), "query", "queries"
    else:
        positions, axis, unit = along, "way along the drive (m)", "m"
        ends = float(along[max(gap.start - 1, 0)]), float(along[min(gap.stop, len(along) - 1)])
    return drawn(
        (11, 0.8 + 1.05 * len(bands)),
        "A band for each method along the route: up if its matches are right, down if they are "
        "wrong.",
        route_strip,
        positions,
        bands,
        gap=ends if ends[1] > ends[0] else None,
        along=axis,
        unit=unit,
    )


def mistakes(study: Study, queries: Images, references: Images) -> dict[str, Picture]:
    """The worst mistakes as images, by the names of their files: the wrong matches of the shown
    method with the best scores, and the single matches that are trusted and wrong.
    """
    if queries is None and references is None:
        return {}
    found = {}
    for name, title, chosen, place in (
        (
            "mistakes.png",
            f"Wrong matches of {study.shown.name}, the best scores first",
            study.mistakes(MISTAKES),
            study.shown.matches.place,
        ),
        (
            "trusted_mistakes.png",
            "Single matches that are trusted and wrong, the nearest first",
            study.trusted_mistakes(MISTAKES),
            study.run.single_place,
        ),
    ):
        shown = [_example(study, query, int(place[query]), queries, references) for query in chosen]
        across = min(2, len(shown))
        width = 11.0 if across == 2 else 5.6
        captions = "; ".join(f"{example.images[0][0]}: {example.caption}" for example in shown)
        if shown:
            found[name] = drawn(
                (width, examples_height(shown, width - 0.2, across=across) + 0.2),
                f"{title}: the query, the place it was matched to, and its true place. {captions}.",
                examples,
                shown,
                across=across,
                caption=f"{title}.",
                textured=True,
            )
    return found


def _example(study: Study, query: int, place: int, queries: Images, references: Images) -> Example:
    true, segments = int(study.true_place[query]), study.context.segments
    several = segments is not None and len(segments) > 1
    match = f"{'match:' if several else 'matched to'} {place_in(segments, place)}"
    images = [
        (f"query {query}", None if queries is None else queries[query]),
        (match, None if references is None else references[place]),
    ]
    if true >= 0:
        name = f"true {place_in(segments, true)}"
        images.append((name, None if references is None else references[true]))
    trusted = "trusted" if study.run.trusted[query] else "not trusted"
    return Example(images, f"{study.off(query, place)}, {trusted}")
