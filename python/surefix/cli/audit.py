"""``surefix audit``: what techniques are worth on a route, without ground truth."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Literal

import numpy as np
import typer

from surefix import Audit, audit, match, match_distances
from surefix._progress import terminal_bar
from surefix._terminal import say
from surefix._words import columns, plural
from surefix.cli import inputs
from surefix.cli.align import refusing_options
from surefix.cli.flags import documented
from surefix.cli.networks import Model, ModelOptions, Output, Weights
from surefix.cli.recorded import open_drive
from surefix.cli.route import SaveMap

# Below this mean confidence of the alignment, an audit is not worth much.
DOUBTFUL = 0.7
# Of so low a recall@1, an audit by a motion of several speeds was off most (docs/howto/align.md).
WEAK = 0.3
FEW = 20
# Confidences of the tracker in the table.
THRESHOLDS = (0.5, 0.8, 0.9, 0.95, 0.99)


@documented
def audit_(
    route: str,
    queries: inputs.Place | None = None,
    motion: Literal["steady", "free", "any"] = "any",
    tolerance: Annotated[int, typer.Option(min=0)] = 1,
    accept: Annotated[float | None, typer.Option(min=0, max=1)] = None,
    fuse: list[str] | None = None,
    similarity: bool = False,
    model: Model = None,
    weights: Weights = None,
    output: Output = None,
    save_map: SaveMap = None,
    topic: inputs.Topic = None,
    stride: inputs.Stride = 1,
    every: inputs.Every = None,
    metres: inputs.Metres = None,
    odometry: inputs.Odometry = None,
    spacing: inputs.Spacing = None,
    places_per_metre: inputs.PlacesPerMetre = None,
    order: inputs.Order = "name",
    strict: inputs.Strict = False,
    crop: inputs.Crop = False,
) -> None:
    """Estimate how often techniques are right on a recorded drive, without ground truth.

    Parameters
    ----------
    route: The map, from `surefix map build`; or images as QUERIES, of which one is made in memory;
        or a .npy of distances, (places, queries).
    queries: A folder of images, a pattern, a .npy of images or of descriptors, a video or a bag;
        none with distances.
    motion: steady if both drives took frames at the same distances, free for 0 to 2 places a
        query, any for 0 to 5.
    tolerance: A match is right within this many places.
    accept: Count the tracker's fixes of this confidence or more, as `surefix run --accept` does.
    fuse: Another technique's map of the same places, or .npy of distances, once each: which
        technique is best here?
    similarity: The .npy holds similarities s: the distances are 1 - s.
    """
    sampling: dict[str, Any] = {"topic": topic, "stride": stride, "every": every}
    sampling |= {"metres": metres, "odometry": odometry}
    sampling |= {"order": order, "strict": strict, "crop": crop}
    scale: dict[str, Any] = {"spacing": spacing, "places_per_metre": places_per_metre}
    named = ModelOptions(model, weights, output)
    drive = open_drive(route, queries, fuse or (), similarity, named, save_map, **scale, **sampling)
    how: dict[str, Any] = {"motion": motion, "tolerance": tolerance, "advance": drive.advance}
    if drive.maps:
        run = refusing_options(match, *drive.given, **how, progress=terminal_bar("Matching"))
    else:
        run = refusing_options(match_distances, *drive.given, **how)
    how["progress"] = terminal_bar("Aligning")
    found = refusing_options(audit, *drive.given, run=run, **how)
    of = "of the techniques fused " if found.techniques else ""
    say(f"Single matches {of}right: {found.recall_at_1} of {_count(found)}")
    trusted = int(found.trusted.sum())
    if trusted:
        say(f"Trusted matches right: {found.trusted_precision} of {trusted}")
    else:
        say("Trusted matches: none")
    if accept is not None:
        accepted, right = (
            int(found.accepted(1 - accept).sum()),
            found.accepted_precision(1 - accept),
        )
        said = f"{right} of {accepted}" if accepted else "there are none"
        say(f"Fixes of a confidence of {accept:g} or more that are right: {said}")
    if found.techniques:
        _print_ranking(found, drive.names)
    _print_thresholds(found)
    say("", "Each with its 95 % interval, estimated from an alignment, without ground truth.")
    for warning in _warnings(found, motion):
        say(warning)


def _warnings(found: Audit, motion: str) -> Iterator[str]:
    """When not to believe it, in words."""
    sure = float(np.mean(found.confidence))
    if sure < DOUBTFUL:
        yield (
            f"Do not rely on it: the alignment has a mean confidence of {sure:.2f}. Is --motion "
            f"{motion} that of these drives? Is the technique too weak for the route?"
        )
    weak = found.recall_at_1 < WEAK and not found.techniques
    if weak and motion != "steady":
        yield (
            f"A technique of so few right matches is misjudged more with --motion {motion}, as its "
            "alignment goes wrong with it: --odometry, or a stronger technique beside it with "
            "--fuse, helps."
        )
    if 0 < found.trusted.sum() < FEW:
        yield f"Fewer than {FEW} matches are trusted: their share says little."


def _count(found: Audit) -> str:
    return plural(len(found), "query", "queries")


def _print_ranking(found: Audit, names: Sequence[str]) -> None:
    """The techniques, the best first, and which of them the drive cannot tell from the best."""
    order = sorted(range(len(names)), key=lambda index: -found.techniques[index].recall_at_1)
    best = found.techniques[order[0]]
    rows = [("technique", "single matches right", "less than the best", "trusted right")]
    level = []
    for index in order:
        each = found.techniques[index]
        less = best.difference(each)
        trusted = str(each.trusted_precision) if each.trusted.any() else "none trusted"
        rows.append(
            (names[index], str(each.recall_at_1), "" if each is best else str(less), trusted)
        )
        if each is not best and less.low <= 0:
            level.append(names[index])
    say("", "The techniques, all by one alignment of their fusion:")
    print_columns(rows)
    first = names[order[0]]
    if level:
        say(f"{first} is not surely the best: the drive does not tell it from {', '.join(level)}.")
    else:
        say(f"{first} is the best here: better than each of the others beyond the interval.")


def _print_thresholds(found: Audit) -> None:
    """The fixes of the tracker that each confidence accepts, and how many of them are right."""
    rows = [("confidence", "accepted", "right of these")]
    for threshold in THRESHOLDS:
        accepted = found.accepted(1 - threshold)
        right = str(found.accepted_precision(1 - threshold)) if accepted.any() else "none"
        rows.append((f"{threshold:g}", f"{accepted.mean():.0%}", right))
    say("", "The tracker's fixes, if those of at least a confidence are accepted:")
    print_columns(rows)


def print_columns(rows: Sequence[Sequence[str]]) -> None:
    """A table in plain columns, its header first."""
    say(*columns(rows))
