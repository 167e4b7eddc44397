"""``surefix tune``: the settings of a route and a threshold, chosen on a recorded drive."""

import sys
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from surefix import Settings, Tuned, tune
from surefix._terminal import say
from surefix._words import plural
from surefix.cli import inputs
from surefix.cli.align import refusing_options
from surefix.cli.audit import print_columns
from surefix.cli.drives import truth_without
from surefix.cli.flags import TRUTH, documented, with_ray
from surefix.cli.inputs import check_apart, check_not_read, refuse
from surefix.cli.networks import Model, ModelOptions, Output, Weights
from surefix.cli.recorded import Drive, open_drive
from surefix.cli.route import SaveMap
from surefix.cli.where import GAP, Places, PositionGap, Queries, Where, by_positions, by_truth
from surefix.errors import check_folder


@with_ray
@documented
def tune_(
    route: str,
    queries: inputs.Place | None = None,
    out: Annotated[Path, typer.Option("--out", "-o")] = Path("route.toml"),
    truth: Annotated[str | None, TRUTH] = None,
    positions: Annotated[Path | None, TRUTH] = None,
    query_positions: Annotated[str | None, TRUTH] = None,
    position_gap: PositionGap = GAP,
    tolerance: Annotated[float | None, typer.Option(min=0, rich_help_panel=TRUTH)] = None,
    wrong: float = 0.05,
    sure: float = 0.95,
    motion: Literal["steady", "free", "any"] = "any",
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
    """Choose the settings for a route on a recorded drive, and a threshold with a promise.

    Parameters
    ----------
    route: The map, from `surefix map build`; or images as QUERIES, of which one is made in memory;
        or a .npy of distances, (places, queries).
    queries: A folder of images, a pattern, a .npy of images or of descriptors, a video or a bag;
        none with distances.
    out: The .toml to write, for `surefix run --config`.
    truth: Where each query was, as for `surefix eval`: identity, a .npy or a .csv. Without, the
        drive is aligned, which chooses no motion.
    positions: In place of --truth: metres of each place, .npy or .csv; or a .csv with the header
        latitude,longitude. The map's by default.
    query_positions: In place of --truth: those of each query, as for `surefix eval`.
    tolerance: The greatest distance from the truth of a right match: in places, 1 by default; with
        positions in metres.
    wrong: The promise: at most this share of the accepted fixes is wrong ...
    sure: ... with this probability.
    motion: How the robot moved, if nothing better is found: any, steady or free.
    fuse: Another technique's map of the same places, or .npy of distances, once each: their
        evidence is fused, and weighted.
    similarity: The .npy holds similarities s: the distances are 1 - s.
    """
    refuse(out.suffix != ".toml", f"--out: expected a name that ends in .toml, got {out}")
    by_position = query_positions is not None
    given = truth is not None
    refuse(given and (by_position or positions is not None), "--truth: expected no positions too")
    alone = positions is not None and not by_position
    refuse(alone, "--positions: expected --query-positions too")
    expected = "--tolerance: expected how many metres from the truth are right, got none"
    refuse(by_position and tolerance is None, expected)
    part = not by_position and tolerance is not None and not tolerance.is_integer()
    part = part and not str(truth).lower().endswith(".npz")
    refuse(part, f"--tolerance: expected a whole number of places, got {tolerance}")
    named = ModelOptions(model, weights, output)
    read = [route, queries, truth, positions, query_positions, odometry, *(fuse or ())]
    check_not_read(out, [*read, *named.files])
    check_apart({"--out": out, "--save-map": save_map})
    check_folder(out, "cannot write the settings")
    sampling: dict[str, Any] = {"topic": topic, "stride": stride, "every": every}
    sampling |= {"metres": metres, "odometry": odometry}
    sampling |= {"order": order, "strict": strict, "crop": crop}
    scale: dict[str, Any] = {"spacing": spacing, "places_per_metre": places_per_metre}
    drive = open_drive(
        route, queries, fuse or (), similarity, named, save_map, read, **scale, **sampling
    )

    count = len(drive.rows[0]) if drive.maps else drive.rows[0].shape[1]
    first = drive.maps[0] if drive.maps else None
    mapped = Places(drive.places) if first is None else Places.of(first)
    recorded = drive.numbers, drive.total
    driven = Queries(count + len(drive.bad), drive.seen, drive.times, drive.bag, *recorded)
    known: Where | None = None
    if truth is not None:
        known = by_truth(truth, mapped, driven, tolerance)
    elif query_positions is not None:
        assert tolerance is not None
        known = by_positions(positions, query_positions, mapped, driven, tolerance, position_gap)
    tolerance = known.tolerance if known else 1 if tolerance is None else tolerance
    at = None if known is None else truth_without(known.truth, drive.bad)
    how: dict[str, Any] = {"truth": at, "tolerance": tolerance}
    how |= {"wrong": wrong, "sure": sure, "motion": motion, "advance": drive.advance}
    tuned = refusing_options(tune, *drive.given, **how)

    settings = tuned.settings
    names = {"route": ", ".join([route, *(fuse or ())]), "queries": str(queries or route)}
    measured = settings.measured
    names = {key: f"{name}, {measured[key]}" for key, name in names.items()}
    Settings(config=settings, measured=measured | names).save(out)
    _print_trials(tuned)
    _print_choice(tuned, drive, aligned=known is None)
    for each in tuned.contradictions:
        said = "Warning: an alignment that is sure of itself contradicts the truth"
        say(f"{said}, {each}: it may be the truth that is wrong", file=sys.stderr)
    say(f"Wrote {out}, for surefix run --config {out}")


def _print_trials(tuned: Tuned) -> None:
    rows = [("setting", "area", "more than the first", "")]
    for trial in tuned.trials:
        more = "" if trial is tuned.trials[0] else str(trial.difference)
        rows.append((trial.name, str(trial.area), more, "chosen" if trial.chosen else ""))
    print_columns(rows)


def _print_choice(tuned: Tuned, drive: Drive, aligned: bool) -> None:
    """The choice, why, and the promise."""
    chosen, first = tuned.chosen, tuned.trials[0]
    measured = tuned.settings.measured
    others = plural(len(tuned.trials) - 1, "other setting")
    say("", f"Areas under the precision-recall curve, with 95 % intervals, by {measured['judged']}")
    if chosen is not first:
        say(f"{chosen.name}: surely better than {first.name}, even as the best of {others}")
    elif len(tuned.trials) > 1:
        say(f"{first.name}, unchanged: none of {others} is surely better here")
    if aligned:
        say(f"The motion is as given, {first.name}: an alignment cannot choose it, a --truth can")
    if len(drive.names) > 1 and "technique_weights" in chosen.options:
        weights = zip(drive.names, chosen.options["technique_weights"], strict=True)
        say("Weights: " + ", ".join(f"{name} {weight:g}" for name, weight in weights))
    say(f"Threshold, by {measured['calibrated_on']}: {measured['promise']}")
