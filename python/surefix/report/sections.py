"""The sections of a study's page: plain words about each part, with its numbers."""

from collections.abc import Mapping, Sequence
from datetime import datetime

import numpy as np

from surefix import __version__
from surefix._words import plural
from surefix.baselines.distances import Places
from surefix.plot.outcome import longest_gap
from surefix.report import tables
from surefix.report.page import Picture, Section, Table, Tile
from surefix.study import KS, UPTO, Result, Study, verdict
from surefix.study.confidence import ALARM, HOLD, SURE

__all__ = [
    "drives",
    "identity",
    "lead",
    "made",
    "methods",
    "mistakes",
    "on_average",
    "route",
    "share",
    "tiles",
]

RECALLS = {
    "correct": "accepted correct matches over all correct matches of the same method, the paper's "
    "wording",
    "place_exists": "accepted correct matches over all queries that have a true place",
    "rejected": "accepted correct matches over these and all rejected queries, as in the authors' "
    "earlier code",
}


def lead(study: Study) -> Sequence[str]:
    """The data and the verdict."""
    n, m = study.distances.shape
    known = int((study.true_place >= 0).sum())
    of = "of the true position" if study.by_position else "of a true one"
    return (
        f"{plural(m, 'query', 'queries')} on a map of {plural(n, 'place')}; {known} of them "
        f"{'has' if known == 1 else 'have'} a true place. "
        f"A match is right {study.correct_means} {of}.",
        verdict(study.shown),
    )


def tiles(study: Study) -> Sequence[Tile]:
    """The numbers to take away."""
    shown, plain, t = study.shown, study.baseline, study.trust
    area, low, high = shown.area
    difference, below, above = shown.difference
    false, plain_false = (
        tables.count(result.curve.false_positives_at(UPTO)) for result in (shown, plain)
    )
    trusted = t.true_positives + t.false_positives
    total = trusted + t.false_negatives + t.true_negatives
    first = f"{study.recalls_at[0]:.3f}" if len(study.recalls_at) else "none"
    rest = zip(KS[1:], study.recalls_at[1:], strict=False)
    others = ", ".join(f"R@{k} {value:.3f}" for k, value in rest)
    at, interval = f"recall {UPTO:g}", f"95 %: {low:.3f} to {high:.3f}"
    apart = f"95 %: {below:+.3f} to {above:+.3f}: {shown.outcome}"
    against = f"against the plain sequence's {plain.area[0]:.3f}"
    nearest = "of the queries with a true place have it nearest (R@1)"
    return (
        Tile("area", f"{area:.3f}", f"area to {at}, {shown.name}", interval),
        Tile("difference", f"{difference:+.3f}", against, apart),
        Tile("false", false, f"false positives at {at}", f"plain sequence: {plain_false}"),
        share(
            "trusted-right", t.true_positives, trusted, "of the trusted single matches are right"
        ),
        share("trusted", trusted, total, "of the single matches are trusted"),
        Tile("recall-at-1", first, nearest, others),
    )


def methods(study: Study, said: Result | None = None) -> Sequence[Section]:
    """The table of all methods, and a sentence or two for each but the one that was ``said``."""
    table = Section(
        "Every method",
        (
            "The area is that under the precision-recall curve up to recall 0.2, divided by 0.2. "
            "Its interval, and that of the difference, come from a bootstrap over blocks of "
            "consecutive queries, as neighbours are not independent. If the interval of a "
            "difference holds 0, the two are level: the drive does not tell which is better.",
            "Precision is the share of the accepted matches that is correct. Recall, the "
            f'convention "{study.recall}", is {RECALLS[study.recall]}. Published numbers differ in '
            "this convention: compare only like with like.",
        ),
        tables=(tables.methods(study),),
    )
    others = [verdict(each) for each in study.results if each is not said]
    return table, Section("In words", (), points=others)


def identity(question: str) -> str:
    """The line above a title: what the page answers, when, and by which version."""
    now = datetime.now().astimezone().strftime("%Y-%m-%d %H:%M")
    return f"{question} \u00b7 {now} \u00b7 surefix {__version__}"


def on_average(studies: Sequence[Study]) -> str:
    """The method of the largest area over all drives, beside the plain sequence."""
    areas = tables.areas(studies).mean(axis=0)
    names = [result.name for result in studies[0].results]
    best = int(np.argmax(areas))
    plain = names.index(studies[0].baseline.name)
    beside = f"; {names[plain]} has {areas[plain]:.3f}" if best != plain else ""
    return (
        f"Over all {len(studies)} drives, {names[best]} has the largest area to 100 % "
        f"recall, {areas[best]:.3f} on average{beside}."
    )


def drives(studies: Sequence[Study], pictures: Mapping[str, Picture]) -> Sequence[Section]:
    """How each method fares on every drive, and how honest its confidence is."""
    several = len(studies) > 1
    made = "All but the first are made of the recorded one: at rest its frame is repeated."
    table = Section(
        "Drive by drive" if several else "On and off the map",
        (
            "\u201cRight\u201d is a share of the queries on the map. The ROC area: how well the "
            "others are told from them, by the method's own probability to be off the map, or by "
            "its score if it has none. Frames to notice: from leaving the map until the "
            f"confidence is {1 - ALARM:g} or less, or the probability to be off it {ALARM:g} or "
            "more. Frames to find back: from a kidnap or the return until the answer is right for "
            f"{HOLD} queries, with a confidence of at least {SURE:g} in the first if the method "
            "says one. Both are medians over the events, left out if half of them or more never "
            "ended.",
            *((made,) if several else ()),
        ),
        tables=[*((tables.every(studies),) if several else ()), *map(tables.drive, studies)],
    )
    honest = Section(
        "How honest its confidence is",
        (
            "A confidence is honest if, of the answers that are said to be right with 0.8, 0.8 are "
            "right. Below the diagonal it promises too much. The number beside a name is the mean "
            "distance from the diagonal (expected calibration error). The larger a point, the more "
            "answers; the lines leave out points of fewer than five.",
        ),
        pictures,
    )
    return (table, honest) if pictures else (table,)


def trust(study: Study) -> Section:
    """The trust flag."""
    t = study.trust
    wrong = t.false_positives + t.true_negatives
    passed = f"{t.false_positives} of the {wrong} wrong ones" if wrong else "there is no wrong one"
    rows = (
        ("trusted", str(t.true_positives), str(t.false_positives)),
        ("not trusted", str(t.false_negatives), str(t.true_negatives)),
    )
    return Section(
        "May its answers be trusted?",
        (
            "The trust flag is about a query's own single match, before any sequence: the nearest "
            "place and the sharpest dip of the distances agree.",
            f"It lets pass {t.true_positives} of the {t.true_positives + t.false_negatives} right "
            f"matches, and {passed}.",
        ),
        tables=[Table("trust", "Single matches.", ("", "right", "wrong"), rows)],
    )


def route(study: Study) -> Section:
    """Right and wrong along the route."""
    gap = longest_gap(study.single_right & study.run.trusted & study.single_judged)
    words = (
        "none, every query's is."
        if len(gap) == 0
        else f"1 query, {gap.start}."
        if len(gap) == 1
        else f"{len(gap)} queries, from {gap.start} to {gap.stop - 1}."
    )
    paragraphs = [f"The longest stretch without a single match that is trusted and right: {words}"]
    shown, plain = study.shown, study.baseline
    if shown is not plain:
        both = shown.judged & shown.accepted & plain.judged
        repaired, spoiled = (
            _stretches(np.flatnonzero(both & one.right & ~other.right))
            for one, other in ((shown, plain), (plain, shown))
        )
        paragraphs.append(
            f"Queries that {shown.name} repairs: {repaired}. Queries that it spoils: {spoiled}."
        )
    return Section("Where along the route it fails", paragraphs)


def mistakes(study: Study, names: tables.Names, places: tables.Names) -> Section:
    """The worst mistakes."""
    found = tables.worst(study, names, places, tables.MISTAKES)
    says = [
        f"Wrong, with the best scores of all: {study.shown.name} would accept them first. Then the "
        "single matches that the consensus trusts though they are wrong."
        if found
        else f"None: every judged match of {study.shown.name} is right, and no trusted one is "
        "wrong."
    ]
    return Section("The worst confident mistakes", says, tables=found)


def made(*rows: tuple[str, str], command: str = "") -> Section:
    """The command, if it is not above, and anything else that it takes to do it again."""
    first = "Made with", f"surefix {__version__}{command and f': {command}'}"
    words = ("So that it can be checked, and done again.",)
    return Section("How this was made", words, facts=(first, *rows))


def share(name: str, part: int, whole: int, label: str) -> Tile:
    """A part in per cent."""
    value = f"{100 * part / whole:.1f} %" if whole else "none"
    return Tile(name, value, label, f"{part} of {whole}")


def _stretches(queries: Places, most: int = 12) -> str:
    """Runs of consecutive queries, in words."""
    if len(queries) == 0:
        return "none"
    parts = np.split(queries, np.flatnonzero(np.diff(queries) > 1) + 1)
    words = [
        str(part[0]) if len(part) == 1 else f"{part[0]} to {part[-1]}" for part in parts[:most]
    ]
    left = len(parts) - most
    more = f" and {plural(left, 'stretch', 'stretches')} more (in fixes.csv)" if left > 0 else ""
    return f"{', '.join(words)}{more} ({len(queries)} in all)"
