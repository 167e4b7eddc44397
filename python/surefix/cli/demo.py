"""``surefix demo``: a generated route, mapped, localized live, and shown in a report."""

import sys
import time
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer

from surefix import Localizer, Map, Sad, SurefixError, match_distances
from surefix._extra import drawing
from surefix._terminal import Console, say
from surefix.baselines import Context
from surefix.cli.inputs import refuse
from surefix.cli.pages import Open, show
from surefix.cli.save_drives import Form
from surefix.cli.save_drives import save_drives as written
from surefix.live import TerminalView
from surefix.simulate import Route, Traverse
from surefix.study import UPTO, Study
from surefix.study.demo import ACCEPT, Demo
from surefix.study.town import BEST, ONE_LINE, drive_through

__all__ = ["demo"]

# The odometry of the second drive: its scale, and the noise of a step.
WHEELS = {"scale": 1.02, "noise": 0.05}
# With odometry there is one speed: that of the wheels.
MOTION: Final = "any"
SPACING = 3.0
# The places of a town, at most.
TOWN = 300
# The terminal's columns for lines that are not broken.
WIDE = 110


def legs(places: int) -> list[tuple[str, int]]:
    """On along the whole route, but for a stop and a detour."""
    first, second, detour = (round(share * places) for share in (0.35, 0.15, 0.12))
    stop = max(1, places // 25)
    rest = places - first - second - detour
    return [
        ("drive", first),
        ("stop", stop),
        ("drive", second),
        ("detour", detour),
        ("drive", rest),
    ]


def demo(
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", help="The folder to write; an earlier demo's files in it are replaced."
        ),
    ] = Path("out/demo"),
    places: Annotated[
        int, typer.Option(min=20, max=5000, help="Places of the route, 3 m apart.")
    ] = 1000,
    width: Annotated[
        int, typer.Option(min=32, max=1920, help="Width of a frame, in pixels.")
    ] = 320,
    height: Annotated[
        int, typer.Option(min=16, max=1080, help="Height of a frame, in pixels.")
    ] = 160,
    seed: Annotated[int, typer.Option(min=0, help="Another seed is another route.")] = 1,
    sequence_length: Annotated[
        int, typer.Option("--sequence-length", "-L", min=1, max=20, help="Queries a sequence.")
    ] = 2,
    town: Annotated[
        bool,
        typer.Option(
            "--town", help="Three roads with a ring and junctions, mapped in two seasons, instead."
        ),
    ] = False,
    save_drives: Annotated[
        Path | None,
        typer.Option(
            "--save-drives", help="Write two drives along the route to this folder, and end."
        ),
    ] = None,
    form: Annotated[
        Form | None,
        typer.Option("--as", help="--save-drives: as images (by default), videos or ROS 2 bags."),
    ] = None,
    open_: Open = False,
) -> None:
    """See it work, without any data: drive a generated route twice, localize live, get a report."""
    begin = time.perf_counter()
    refuse(form is not None and save_drives is None, "--as: expected --save-drives too")
    refuse(town and save_drives is not None, "--save-drives: expected no --town, got both")
    if save_drives is not None:
        _save_drives(
            save_drives, form or "images", Route(places=places, size=(width, height), seed=seed)
        )
        return
    undrawn = _prepare(out)
    if town:
        page = _town(out, min(places, TOWN), (width, height), seed, undrawn)
        if page is not None:
            show(page, open_)
        return
    route = Route(places=places, size=(width, height), spacing=SPACING, seed=seed)
    reference, revisit = route.reference(), route.revisit(legs=legs(places))
    kilometres = float(reference.positions[-1]) / 1000
    size = f"{width} x {height} pixels"
    say(f"Route: {places} places along {kilometres:.1f} km, generated (seed {seed}), {size}")

    start = time.perf_counter()
    known = Map.from_images(reference, Sad())
    mapped = time.perf_counter()
    rows = f"{len(known)} places x {known.dim} {known.dtype}"
    say(f"Mapped on a summer noon: {rows}, in {mapped - start:.1f} s")
    demo_ = _localize(known, reference, revisit, seed, sequence_length)
    localized = time.perf_counter()
    run, right, sure = demo_.run, demo_.right, demo_.sure
    off = int(demo_.study.off_map.sum())
    median, p99 = np.quantile(demo_.latency, (0.5, 0.99)) * 1000
    weighted, plain = (r.curve.auc(UPTO) for r in (demo_.study.shown, demo_.study.baseline))
    say(
        f"Localized on a winter afternoon: {len(right)} fixes, {median:.2f} ms each (median; p99 "
        f"{p99:.2f} ms)",
        f"All fixes: {int(right.sum())} of the {len(right) - off} on the map right, and {off} "
        "taken off it",
        f"Trusted fixes: {int((run.trusted & right).sum())} of {int(run.trusted.sum())} right, "
        f"{int((run.trusted & ~right).sum())} wrong",
        f"Sure fixes, of confidence {ACCEPT:g} or more: {int((sure & right).sum())} of "
        f"{int(sure.sum())} right, {int((sure & ~right).sum())} wrong",
        f"The paper's sequence, area under the precision-recall curve up to recall {UPTO:g}: "
        f"{weighted:.2f}, without weighting {plain:.2f}",
    )

    if undrawn is not None:
        say(undrawn)
        return
    options = f"--places {places} --width {width} --height {height} --seed {seed}"
    command = f"surefix demo {options} --sequence-length {sequence_length}"
    drive = "the second drive, drawn and localized", localized - mapped
    seconds = (("mapping", mapped - start), drive)
    with Console(stderr=True, force_terminal=sys.stderr.isatty()).status("Drawing the report"):
        # Not at the top: matplotlib is an extra, and slow to import.
        from surefix.report.demo import write_report

        report = write_report(demo_, out, command, seconds)
    took = time.perf_counter() - begin
    say(f"Made {report}, with its pictures and the fixes beside it, in {took:.1f} s")
    show(report, open_)


def _save_drives(folder: Path, form: Form, road: Route) -> None:
    summer, winter = written(folder, form, road)
    say(f"Made {summer} and {winter}; try: surefix run {summer} {winter}")


def _prepare(out: Path) -> str | None:
    """Makes the folder of the report; or the words on the package without which there is none."""
    try:
        drawing("the report")
    except SurefixError as error:
        return f"No report and no pictures: {error}"
    from surefix.report.page import output_folder

    output_folder(out)
    return None


def _town(
    out: Path, places: int, size: tuple[int, int], seed: int, undrawn: str | None
) -> Path | None:
    begin = time.perf_counter()
    made = drive_through(places, size, seed)
    m, roads = len(made.drive), made.town.segments
    say(
        f"Town: {len(roads)} roads of {places} places, one of them a ring, with "
        f"{len(roads.links)} junctions, generated (seed {seed})",
        "Mapped on a summer noon and in autumn; driven on a winter afternoon: in, one and a half "
        "times round, and out",
    )
    for name, told in ((BEST, "On the map of the town"), (ONE_LINE, "On a map that is one line")):
        right, sure = made.right[name], made.sure(name)
        say(
            f"{told}: {int(right.sum())} of {m} fixes right; of the {int(sure.sum())} sure ones "
            f"(confidence {ACCEPT:g} or more) {int((sure & right).sum())}"
        )
    if undrawn is not None:
        say(undrawn)
        return None
    command = (
        f"surefix demo --town --places {places} --width {size[0]} --height {size[1]} --seed {seed}"
    )
    with Console(stderr=True, force_terminal=sys.stderr.isatty()).status("Drawing the report"):
        from surefix.report.town import write_town

        report = write_town(made, out, command, time.perf_counter() - begin)
    took = time.perf_counter() - begin
    say(f"Made {report}, with its pictures, the map and the fixes beside it, in {took:.1f} s")
    return report


def _localize(
    known: Map, reference: Traverse, revisit: Traverse, seed: int, sequence_length: int
) -> Demo:
    """Drives a second time: pushes each frame when it is there, as a robot would."""
    localizer = Localizer(known, sequence_length=sequence_length, motion=MOTION)
    advance = revisit.odometry(**WHEELS) / SPACING
    distances = np.empty((len(known), len(revisit)), np.float32, order="F")
    latency = np.empty(len(revisit))
    console = Console(stderr=True, force_terminal=sys.stderr.isatty())
    # For the lines that follow.
    spare = 12 if console.width < WIDE else 8
    view = TerminalView(
        known, total=len(revisit), references=reference, console=console, spare=spare
    )
    with view:
        for query in range(len(revisit)):
            image = revisit[query]
            start = time.perf_counter()
            fix = localizer.push(image, advance=advance[query])
            latency[query] = time.perf_counter() - start
            distances[:, query] = localizer.distances
            # Drawn on a terminal only: a line a fix would bury the demo's own.
            if console.is_terminal:
                view.update(image, fix, localizer, 1e6 * latency[query])
    # The same fixes again, to the bit, and beside them those of the sequence without a tracker.
    truth = revisit.truth(reference)
    context = Context(sequence_length, floor="running", truth=truth, advance=advance)
    run = match_distances(distances, advance=advance, **context.options | {"motion": MOTION})
    study = Study(distances, context, names=("sequence", "weighted", "track_odometry"))
    return Demo(study, run, reference, revisit, seed, latency)
