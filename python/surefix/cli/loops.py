"""``surefix loops``: close loops on a drive without a map."""

import itertools
import sys
from contextlib import AbstractContextManager, closing, nullcontext
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, TextIO

import typer

from surefix import LoopCloser, SurefixValueError, frames
from surefix._progress import Bar, terminal_bar
from surefix._saving import words_on_kept
from surefix._terminal import say
from surefix._words import plural
from surefix.cli import inputs
from surefix.cli.flags import documented
from surefix.cli.inputs import Place, check_not_read, listed, notes_on, refuse, scale_of
from surefix.cli.networks import Model, ModelOptions, Output, Weights, open_network
from surefix.tables.csv_rows import row_writer
from surefix.tables.fix_files import created

COLUMNS = ("frame", "place", "confidence", "frame_name", "place_name")
MOTIONS = Literal["loops", "steady", "free", "any"]
NO_SCALE = "--odometry: expected --metres, --spacing or --places-per-metre too"


@documented
def loops(
    drive: Place,
    out: Annotated[Path | None, typer.Option("--out", "-o")] = None,
    exclude: Annotated[int, typer.Option(min=1)] = 30,
    confidence: Annotated[float, typer.Option(min=0, max=1)] = 0.9,
    lasting: Annotated[int, typer.Option(min=1)] = 10,
    tolerance: Annotated[int, typer.Option(min=0)] = 3,
    motion: MOTIONS = "loops",
    model: Model = None,
    weights: Weights = None,
    output: Output = None,
    memory: Annotated[float | None, typer.Option(min=1)] = None,
    folder: Path | None = None,
    topic: inputs.Topic = None,
    stride: inputs.Stride = 1,
    every: inputs.Every = None,
    metres: inputs.Metres = None,
    odometry: inputs.Odometry = None,
    spacing: Annotated[float | None, typer.Option()] = None,
    places_per_metre: Annotated[float | None, typer.Option()] = None,
    gap: float | None = None,
    order: inputs.Order = "name",
    strict: inputs.Strict = False,
    spreadsheet: inputs.Spreadsheet = False,
) -> None:
    """Close loops on a drive without a map: each frame is compared with the earlier ones.

    Parameters
    ----------
    drive: A folder of images, a pattern, a video, a ROS bag or MCAP file, or a .npy of images or
        of descriptors.
    out: Write the edges to this file: a .csv, or a .g2o for a pose graph.
    exclude: The newest frames, with which a frame is not compared.
    confidence: The least confidence of an edge.
    lasting: The frames in a row that must be as sure.
    tolerance: Confidence is the belief within this many places.
    motion: How the robot moves along the earlier places.
    memory: The most memory in MB: before it is passed, places go to a file.
    folder: The folder of that file; by default the system's for temporary files.
    spacing: With --odometry: the metres from one frame to the next; by default those of --metres.
    places_per_metre: The same the other way round.
    gap: Treat frames more than this many seconds apart as a break.
    """
    kinds = (".csv", ".g2o")
    bad = out is not None and out.suffix not in kinds
    refuse(bad, f"--out: expected a name that ends in .csv or .g2o, got {out}")
    moved = {"--metres": metres, "--spacing": spacing, "--places-per-metre": places_per_metre}
    for option, value in moved.items():
        refuse(value is not None and odometry is None, f"{option}: expected --odometry too")
    scale = None
    if odometry is not None:
        by = metres if spacing is None and places_per_metre is None else spacing
        scale, _ = scale_of(None, by, places_per_metre)
        refuse(scale is None, NO_SCALE)
    named = ModelOptions(model, weights, output)
    inputs.refuse_map("DRIVE", drive)
    source = frames.open(
        listed(drive),
        topic=topic,
        gap=gap,
        stride=stride,
        every=every,
        metres=metres,
        odometry=odometry,
        places_per_metre=scale,
        order=order,
        skip_bad=not strict,
    )
    network = open_network(named)
    try:
        closer = LoopCloser(
            network,
            exclude,
            confidence=confidence,
            lasting=lasting,
            tolerance=tolerance,
            motion=motion,
            memory=None if memory is None else int(memory * 1e6),
            folder=folder,
        )
    except SurefixValueError as error:
        raise typer.BadParameter(str(error)) from None
    if out is not None:
        check_not_read(out, [*source.files, odometry, *named.files])
    sure = _close(closer, source, out, spreadsheet)
    if out is not None and out.suffix == ".g2o":
        closer.to_g2o(out)
    say(_summary(closer, out), file=sys.stderr)
    if out is None and sys.stdout.isatty() and closer.edges:
        say("not kept: add -o loops.csv", file=sys.stderr)
    if not closer.edges and any(sure):
        say(_said_surest(sure, confidence, lasting), file=sys.stderr)
    if notes := notes_on(source):
        say("; ".join(notes), file=sys.stderr)


def _close(
    closer: LoopCloser, source: frames.Frames, out: Path | None, spreadsheet: bool
) -> list[float]:
    """Pushes each frame, and writes each edge as it comes; the confidence of each frame."""
    names: list[str] = []
    sure: list[float] = []
    write: Any = None
    with _opened(out) as file:
        if file is not None:
            write = row_writer(file, spreadsheet)
            write(COLUMNS)
        bar = Bar(terminal_bar("Closing"), None, source.estimate)
        with closing(source.frames()) as drive:
            for frame in drive:
                if frame.breaks:
                    closer.gap(None if frame.advance is None else 0.0)
                try:
                    said = closer.push(frame.image, frame.advance)
                except SurefixValueError as error:
                    raise SurefixValueError(f"{frame.name}: {error}") from None
                names.append(frame.name)
                sure.append(said.confidence)
                if said.edge and file is not None:
                    where = names[said.place]
                    write((said.frame, said.place, said.confidence, frame.name, where))
                    file.flush()
                bar.show(len(names))
        bar.end(len(names))
    return sure


def _opened(out: Path | None) -> AbstractContextManager[TextIO | None]:
    """Where the edges are written; None if they are not, as a pose graph is written at the end, or
    if they would run over the progress on a terminal.
    """
    if out is None:
        return nullcontext(None if sys.stdout.isatty() else sys.stdout)
    if out.suffix == ".g2o":
        return nullcontext()
    return created(out, "csv", partial(_say_kept, out), "cannot write the edges")


def _say_kept(out: Path, kept: Path, earlier: bool) -> None:
    say(words_on_kept(out, kept, earlier), file=sys.stderr)


def _said_surest(sure: list[float], confidence: float, lasting: int) -> str:
    """How sure the frames of a drive without edges were, in words."""
    best = max(sure)
    said = f"the surest frame is {sure.index(best)}, of confidence {best:.2f}"
    runs = [min(sure[at : at + lasting]) for at in range(len(sure) - lasting + 1)]
    if lasting > 1 and runs:
        said += f"; the surest {lasting} frames in a row have {max(runs):.2f} or more"
    return f"{said} (an edge needs --confidence {confidence:g}, --lasting {lasting})"


def _summary(closer: LoopCloser, out: Path | None) -> str:
    edges = closer.edges
    closed = [edge.frame for edge in edges]
    # Edges in a row are one loop.
    far = sum(b - a > 30 for a, b in itertools.pairwise(closed))
    parts = [f"{plural(closer.frames, 'frame')}, {plural(len(edges), 'edge')}"]
    parts += [f"in {plural(far + 1, 'stretch', 'stretches')}"] if edges else []
    memory = f"{closer.memory / 1e6:.1f} MB of memory"
    memory += f" and {closer.in_file / 1e6:.1f} MB in a file" if closer.in_file else ""
    kept = "" if out is None else f" -> {out}"
    return f"{' '.join(parts)}; {memory}{kept}"
