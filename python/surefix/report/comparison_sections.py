"""A plain word about each part of a comparison, with its numbers."""

from collections.abc import Sequence

import numpy as np

from surefix._words import counted
from surefix.plot.outcome import longest_gap
from surefix.report import comparison_tables as tables
from surefix.report.comparison import KS, UPTO, Comparison
from surefix.report.page import Picture, Section, Tile
from surefix.report.verdict import outcome, verdict

__all__ = ["curves", "lead", "matrix", "methods", "mistakes", "route", "tiles", "trust", "words"]

RECALLS = {
    "correct": "the share of the queries with a correct match that are accepted, so each method is measured by its own",
    "place_exists": "the share of the queries that have a true place",
    "rejected": "true positives over true positives and all rejected queries, as in the authors' earlier code",
}


def lead(comparison: Comparison) -> Sequence[str]:
    """What was compared, and what came of it."""
    n, m = comparison.distances.shape
    known = int((comparison.true_place >= 0).sum())
    shown = comparison.shown
    return (
        f"{counted(m, 'query', 'queries')} on a map of {counted(n, 'place')}; {known} of them "
        f"{'has' if known == 1 else 'have'} a true place. "
        f"A match is right {_within(comparison)}.",
        verdict(comparison, shown),
    )


def tiles(comparison: Comparison) -> Sequence[Tile]:
    """The numbers to take away."""
    shown, plain, t = comparison.shown, comparison.baseline, comparison.trust
    area, low, high = shown.area
    difference, below, above = shown.difference
    false, plain_false = (result.curve.false_positives_at(UPTO) for result in (shown, plain))
    trusted = t.true_positives + t.false_positives
    total = trusted + t.false_negatives + t.true_negatives
    first = f"{comparison.recalls_at[0]:.3f}" if len(comparison.recalls_at) else "none"
    rest = zip(KS[1:], comparison.recalls_at[1:], strict=False)
    return (
        Tile(
            "area",
            f"{area:.3f}",
            f"area to recall {UPTO:g}, {shown.name}",
            f"95 %: {low:.3f} to {high:.3f}",
        ),
        Tile(
            "difference",
            f"{difference:+.3f}",
            f"against the plain sequence's {plain.area[0]:.3f}",
            f"95 %: {below:+.3f} to {above:+.3f}: {outcome(shown)}",
        ),
        Tile(
            "false",
            _count(false),
            f"false positives at recall {UPTO:g}",
            f"plain sequence: {_count(plain_false)}",
        ),
        Tile(
            "trusted-right",
            f"{100 * t.true_positives / trusted:.1f} %" if trusted else "none",
            "of the trusted single matches are right",
            f"{t.true_positives} of {trusted}",
        ),
        Tile(
            "trusted",
            f"{100 * trusted / total:.1f} %" if total else "none",
            "of the single matches are trusted",
            f"{trusted} of {total}",
        ),
        Tile(
            "recall-at-1",
            first,
            "of the queries with a true place have it nearest (R@1)",
            ", ".join(f"R@{k} {value:.3f}" for k, value in rest),
        ),
    )


def methods(comparison: Comparison, intervals: Picture, false: Picture) -> Section:
    """The table of all methods."""
    return Section(
        "Every method",
        (
            "The area is that under the precision-recall curve up to recall 0.2, divided by 0.2. Its interval, and "
            "that of the difference, come from a bootstrap over blocks of consecutive queries, as neighbours are not "
            "independent. Where the interval of a difference holds 0, the drive does not tell which is better.",
        ),
        (intervals, false),
        tables=(tables.methods(comparison),),
    )


def words(comparison: Comparison) -> Section:
    """A sentence or two for each method."""
    return Section(
        "In words",
        ("Where each method wins, where it loses, and what this drive is too short to tell.",),
        points=[verdict(comparison, result) for result in comparison.results],
    )


def curves(comparison: Comparison, pictures: Sequence[Picture]) -> Section:
    """The precision-recall curves."""
    return Section(
        "Precision and recall",
        (
            "Every score of the drive is a threshold once. Precision is the share of the accepted matches that is "
            f'correct. Recall, the convention "{comparison.recall}", is {RECALLS[comparison.recall]}. Published '
            "numbers differ in this convention: compare only like with like.",
        ),
        pictures,
    )


def trust(comparison: Comparison, picture: Picture) -> Section:
    """The trust flag."""
    t = comparison.trust
    wrong = t.false_positives + t.true_negatives
    passed = (
        f"{t.false_positives} of the {wrong} wrong ones"
        if wrong
        else "no wrong one, as there is none"
    )
    return Section(
        "May its answers be trusted?",
        (
            "Trust is a word about a query's own single match, before any sequence: the nearest place and the "
            "sharpest dip of the distances agree.",
            f"It lets pass {t.true_positives} of the {t.true_positives + t.false_negatives} right matches, "
            f"and {passed}.",
        ),
        (picture,),
    )


def matrix(comparison: Comparison, whole: Picture, close: Picture) -> Section:
    """The distance matrix."""
    return Section(
        "The distances, and the answers",
        (
            "Each column is a query, each row a place of the map, and a strong tone means that the two look alike. A "
            f"mark is the match of {comparison.shown.name}: round is right, a cross is wrong; bold is trusted, thin "
            "is not.",
        ),
        (whole, close),
    )


def route(comparison: Comparison, strip: Picture) -> Section:
    """Where along the route."""
    fixed = comparison.single_right & comparison.run.trusted & comparison.single_judged
    gap = longest_gap(fixed)
    words = (
        "There is none: every query's single match is trusted and right."
        if len(gap) == 0
        else f"It has 1 query, {gap.start}."
        if len(gap) == 1
        else f"It has {len(gap)} queries, from {gap.start} to {gap.stop - 1}."
    )
    shown, plain = comparison.shown, comparison.baseline
    both = shown.judged & shown.accepted & plain.judged
    paragraphs = [
        f"The bracket marks the longest stretch without a single match that is trusted and right. {words}"
    ]
    if shown is not plain:
        spoiled = _stretches(np.flatnonzero(both & plain.right & ~shown.right))
        repaired = _stretches(np.flatnonzero(both & ~plain.right & shown.right))
        paragraphs.append(
            f"Queries that {shown.name} repairs: {repaired}. Queries that it spoils: {spoiled}."
        )
    return Section("Where along the route it fails", paragraphs, (strip,))


def mistakes(
    comparison: Comparison,
    pictures: Sequence[Picture],
    names: tables.Names,
    places: tables.Names,
    count: int,
) -> Section:
    """The worst mistakes."""
    found = tables.worst(comparison, names, places, count)
    says = [
        f"Wrong, with the best scores of all: what {comparison.shown.name} would accept first. Then the single matches "
        "that the consensus trusts though they are wrong."
        if found
        else f"None: every match of {comparison.shown.name} that was judged is right, and no trusted one is wrong."
    ]
    if found and not pictures:
        says.append(
            "Give the images of both drives (QUERIES and --references) to see them side by side."
        )
    return Section("The worst confident mistakes", says, pictures, tables=found)


def _within(comparison: Comparison) -> str:
    tolerance = comparison.context.truth_tolerance
    if comparison.by_position:
        return f"within {tolerance:g} m of the true position"
    return f"within {tolerance:g} place{'' if tolerance == 1 else 's'} of a true one"


def _count(count: int | None) -> str:
    return "never there" if count is None else str(count)


def _stretches(queries: np.ndarray[tuple[int, ...], np.dtype[np.int64]], most: int = 12) -> str:
    """Runs of consecutive queries, in words."""
    if len(queries) == 0:
        return "none"
    parts = np.split(queries, np.flatnonzero(np.diff(queries) > 1) + 1)
    words = [
        str(part[0]) if len(part) == 1 else f"{part[0]} to {part[-1]}" for part in parts[:most]
    ]
    left = (
        f" and {counted(len(parts) - most, 'stretch', 'stretches')} more (in fixes.csv)"
        if len(parts) > most
        else ""
    )
    return f"{', '.join(words)}{left} ({len(queries)} in all)"
