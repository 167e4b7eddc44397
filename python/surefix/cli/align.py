"""``surefix align``: where each query of a recorded drive was, without any label."""

import shlex
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
import numpy.typing as npt
import typer

from surefix import SurefixValueError, align
from surefix._extra import drawing
from surefix._progress import terminal_bar
from surefix._terminal import say
from surefix._words import plural
from surefix.cli import inputs
from surefix.cli.flags import documented
from surefix.cli.inputs import check_apart, check_not_read
from surefix.cli.networks import Model, ModelOptions, Output, Weights
from surefix.cli.pages import Open, show, title_of
from surefix.cli.recorded import Drive, open_drive
from surefix.cli.route import SaveMap
from surefix.tables.fix_files import check_form, form_of, rows_of, write_rows

T = TypeVar("T")


@documented
def align_(
    route: str,
    queries: inputs.Place | None = None,
    out: Annotated[Path, typer.Option("--out", "-o")] = Path("truth.csv"),
    report: Path | None = None,
    motion: Literal["steady", "free", "any"] = "any",
    tolerance: Annotated[int, typer.Option(min=0)] = 1,
    least: Annotated[float, typer.Option(min=0, max=1)] = 0.5,
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
    open_: Open = False,
) -> None:
    """Align a recorded drive with a route, without any label: a truth for `surefix eval`.

    Parameters
    ----------
    route: The map, from `surefix map build`; or images as QUERIES, of which one is made in memory;
        or a .npy of distances, (places, queries).
    queries: A folder of images, a pattern, a .npy of images or of descriptors, a video or a bag;
        none with distances.
    out: The .csv to write: query,reference and the confidence of each; segments and positions, if
        the map has them. Or another file of these, by its ending, as `surefix run` writes them:
        .json, .geojson, .tum, .kitti or .mcap.
    report: A folder for a page with the track over the distances, and where it is doubtful.
    motion: steady if both drives took frames at the same distances, free for 0 to 2 places a
        query, any for 0 to 5.
    tolerance: The confidence is the belief within this many places.
    least: A query of a lower confidence has no reference in the file: -1.
    fuse: Another technique's map of the same places, or .npy of distances, once each: their
        evidence is fused.
    similarity: The .npy holds similarities s: the distances are 1 - s.
    """
    try:
        form = form_of(out, None, "--out")
    except SurefixValueError as error:
        raise typer.BadParameter(str(error)) from None
    named = ModelOptions(model, weights, output)
    check_not_read(out, [route, queries, *(fuse or ()), *named.files, odometry])
    check_apart({"--out": out, "--save-map": save_map})
    write_report = _writer(report) if report is not None or open_ else None
    sampling: dict[str, Any] = {"topic": topic, "stride": stride, "every": every}
    sampling |= {"metres": metres, "odometry": odometry}
    sampling |= {"order": order, "strict": strict, "crop": crop}
    scale: dict[str, Any] = {"spacing": spacing, "places_per_metre": places_per_metre}
    drive = open_drive(route, queries, fuse or (), similarity, named, save_map, **scale, **sampling)
    given: dict[str, Any] = {"motion": motion, "tolerance": tolerance, "advance": drive.advance}
    given["progress"] = terminal_bar("Aligning")
    known = drive.maps[0] if drive.maps else None
    kept = [time for index, time in enumerate(drive.times) if index not in drive.bad]
    times = np.array(kept, np.float64)
    timed = len(times) > 0 and bool(np.isfinite(times).all())
    try:
        check_form(form, known, timed)
    except SurefixValueError as error:
        raise typer.BadParameter(str(error)) from None
    alignment = refusing_options(align, *drive.given, **given)
    write_rows(out, form, rows_of(alignment, known, times if timed else None, least), known)
    found = int((alignment.confidence >= least).sum())
    away = int((alignment.off_map >= 0.5).sum())
    where, page = str(out), None
    if write_report is not None:
        report = report or Path(tempfile.mkdtemp(prefix="surefix-"))
        command, how = shlex.join(["surefix", *sys.argv[1:]]), {"motion": motion}
        page = write_report(
            alignment,
            lambda queries: _shown(drive, queries),
            report,
            command,
            places=drive.places,
            breaks=drive.maps[0].segments.breaks.tolist() if drive.maps else (),
            query_names=drive.queries,
            title=title_of(queries, route),
            **how,
        )
        where += f", and a report, {page}"
    say(
        f"{plural(len(alignment), 'query', 'queries')}, {found} with a reference of confidence "
        f"{least:g} or more, {away} probably off the map, in {where}",
        file=sys.stderr,
    )
    if page is not None:
        show(page, open_)


def _writer(folder: Path | None) -> Callable[..., Path]:
    """What writes the report; the folder is made before the slow part."""
    drawing()
    # Not at the top: matplotlib is an extra, and slow to import.
    from surefix.report.align import write_report
    from surefix.report.page import output_folder

    if folder is not None:
        output_folder(folder)
    return write_report


def _shown(drive: Drive, queries: npt.NDArray[np.int64]) -> npt.NDArray[np.float32]:
    """The distances to these queries; of several techniques, the mean of their standardised."""
    D = [drive.distances(technique, queries) for technique in range(len(drive.names))]
    if len(D) == 1:
        return D[0]
    spread = [np.maximum(each.std(axis=0), np.float32(1e-12)) for each in D]
    parts = [(each - each.mean(axis=0)) / by for each, by in zip(D, spread, strict=True)]
    return np.asarray(np.mean(parts, axis=0), np.float32)


def refusing_options(call: Callable[..., T], *arguments: Any, **options: Any) -> T:
    """The result; an option outside its range is bad usage."""
    try:
        return call(*arguments, **options)
    except SurefixValueError as error:
        if str(error).startswith("option"):
            raise typer.BadParameter(str(error)) from None
        raise
