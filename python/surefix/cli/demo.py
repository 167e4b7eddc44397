"""``surefix demo``: a generated route, mapped, localized live, and shown in a report."""

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from rich.console import Console

from surefix import Localizer, Map, Sad, SurefixError
from surefix.baselines import Context
from surefix.live import TerminalView
from surefix.simulate import Route, Traverse
from surefix.study import UPTO, Study

if TYPE_CHECKING:
    from surefix.report.demo import Demo

__all__ = ["demo"]


def demo(
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", help="The folder to write; an earlier demo's files in it are replaced."
        ),
    ] = Path("out/demo"),
    places: Annotated[
        int, typer.Option(min=20, max=5000, help="Frames of each drive, 3 m apart.")
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
) -> None:
    """See it work, without any data: drive a generated route twice, localize live, get a report."""
    begin = time.perf_counter()
    try:
        # Not at the top: matplotlib is an extra, and slow to import.
        from surefix.report.demo import write_report
        from surefix.report.page import output_folder
    except ModuleNotFoundError as error:
        raise SurefixError(str(error)) from None
    output_folder(out)
    route = Route(places=places, size=(width, height), seed=seed)
    reference, revisit = route.reference(), route.revisit()
    kilometres = float(reference.positions[-1]) / 1000
    size = f"{width} x {height} pixels"
    print(f"Route: {places} places along {kilometres:.1f} km, generated (seed {seed}), {size}")

    start = time.perf_counter()
    known = Map.from_images(reference, Sad())
    mapped = time.perf_counter()
    rows = f"{len(known)} places x {known.dim} {known.dtype}"
    print(f"Mapped on a summer noon: {rows}, in {mapped - start:.1f} s")
    demo_ = _localize(known, reference, revisit, seed, sequence_length)
    localized = time.perf_counter()
    study, trusted, right = demo_.study, demo_.study.run.trusted, demo_.right
    median, p99 = np.quantile(demo_.latency, (0.5, 0.99)) * 1000
    weighted, plain = (result.curve.auc(UPTO) for result in (study.shown, study.baseline))
    print(
        f"Localized on a winter afternoon: {len(study)} fixes, {median:.2f} ms each (median; p99 "
        f"{p99:.2f} ms)\n"
        f"All fixes: {int(right.sum())} of {len(study)} right\n"
        f"Trusted fixes: {int((trusted & right).sum())} of {int(trusted.sum())} right, "
        f"{int((trusted & ~right).sum())} wrong\n"
        f"Area under the precision-recall curve up to recall {UPTO:g}: {weighted:.2f}, without "
        f"weighting {plain:.2f}"
    )

    options = f"--places {places} --width {width} --height {height} --seed {seed}"
    command = f"surefix demo {options} --sequence-length {sequence_length}"
    drive = "the second drive, drawn and localized", localized - mapped
    seconds = (("mapping", mapped - start), drive)
    with Console(stderr=True, force_terminal=sys.stderr.isatty()).status("Drawing the report"):
        report = write_report(demo_, out, command, seconds)
    took = time.perf_counter() - begin
    print(f"Made {report}, with its pictures and the fixes beside it, in {took:.1f} s")


def _localize(
    known: Map, reference: Traverse, revisit: Traverse, seed: int, sequence_length: int
) -> "Demo":
    """Drives a second time: pushes each frame when it is there, as a robot would."""
    from surefix.report.demo import Demo

    localizer = Localizer(known, sequence_length=sequence_length)
    distances = np.empty((len(known), len(revisit)), np.float32, order="F")
    latency = np.empty(len(revisit))
    console = Console(stderr=True, force_terminal=sys.stderr.isatty())
    with TerminalView(known, total=len(revisit), references=reference, console=console) as view:
        for query in range(len(revisit)):
            image = revisit[query]
            start = time.perf_counter()
            fix = localizer.push(image)
            latency[query] = time.perf_counter() - start
            distances[:, query] = localizer.distances
            # Drawn on a terminal only: a line a fix would bury the demo's own.
            if console.is_terminal:
                view.update(image, fix, localizer, 1e6 * latency[query])
    # The same fixes again, to the bit, and beside them those without weighting.
    truth = revisit.truth(reference)
    context = Context(sequence_length, floor="running", truth=truth, truth_tolerance=1)
    return Demo(Study(distances, context), reference, revisit, seed, latency)
