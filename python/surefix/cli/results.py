"""What ``surefix eval`` says of a comparison."""

import sys
from typing import TYPE_CHECKING

import numpy as np

from surefix._terminal import say
from surefix._words import plural
from surefix.baselines import Context
from surefix.baselines.truth import part_of, right_matches
from surefix.cli.drives import Float32
from surefix.study.fit import better_fit

if TYPE_CHECKING:
    from surefix.study import Study


def warn_of_similarities(D: Float32, context: Context) -> None:
    """Says so if the places of greatest distance are the right ones."""
    assert context.truth is not None
    truth = len(D), part_of(context.truth, 0, D.shape[1]), context.truth_tolerance
    extremes = np.argmin(D, axis=0), np.argmax(D, axis=0)
    near, far = (int(right_matches(places, *truth)[0].sum()) for places in extremes)
    if far > 2 * near and far >= near + 5:
        say(
            f"Warning: of the places at the greatest distance {far} are right, of the nearest "
            f"{near}: are these similarities? Then use --similarity",
            file=sys.stderr,
        )


def print_results(study: "Study") -> None:
    """A line a method, and a warning if no query of some could be judged by the truth."""
    for result in study.results:
        area, low, high = result.area
        right = f"{result.curve.correct} of {result.curve.judged} right"
        areas = f"{area:.3f} ({low:.3f} to {high:.3f})"
        say(f"{result.name}: area up to recall 0.2 is {areas}, {right}")
    if study.context.floor == "global" and "weighted" in study.names:
        run = "--floor running" if study.context.motion else "--floor running --motion any"
        say(f"weighted by the least distance of all queries; as surefix run: {run}")
    true, false = study.trust.true_positives, study.trust.false_positives
    say(f"Trusted single matches: {true} of {true + false} right, {false} wrong")
    blank = int(np.count_nonzero(study.run.blank))
    if blank:
        some, show = plural(blank, "query", "queries"), "shows" if blank == 1 else "show"
        said = f"{some} of {len(study)} {show} nothing: nothing is matched to them"
        say(f"Warning: {said}", file=sys.stderr)
    names = [result.name for result in study.results if not result.judged.any()]
    if not names:
        return
    length, queries = study.context.sequence_length, len(study)
    if length > queries:
        why = f"a sequence takes {length} queries, and the drive has {queries}"
    else:
        why = "the truth says nothing about any match"
    say(f"Warning: no query was judged for {', '.join(names)}: {why}", file=sys.stderr)


def warn_of_fit(study: "Study") -> None:
    """Says so if a line fits the matches better than a truth of places does."""
    fit = better_fit(study.run.single_place, study.true_place, int(study.tolerance))
    if fit is not None:
        say(f"Warning: the truth may not be of this map and drive: {fit}", file=sys.stderr)
