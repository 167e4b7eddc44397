"""``surefix run``: localize along a route, frame by frame, as a robot would."""

import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack, closing
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, TextIO

import typer

from surefix import Localizer, Map, SurefixFileError, SurefixValueError
from surefix.cli.fixes import CsvFixes, FixRow, JsonFixes, Moment
from surefix.cli.flags import with_options
from surefix.cli.network import network_of
from surefix.cli.tally import Tally
from surefix.cli.views import open_views
from surefix.live import View
from surefix.streams import Frame, Stream, open_stream

__all__ = ["localize", "run"]

# The headings in the help, of the options about frames and about seeing them.
F = "Frames"
S = "Seeing it"


Writer = CsvFixes | JsonFixes


class Format(StrEnum):
    """How fixes are written."""

    csv = "csv"
    json = "json"


class Screen(StrEnum):
    """The numbers of a screen."""

    i8 = "i8"


@with_options()
def run(
    route: Annotated[Path, typer.Argument(help="The map, from `surefix map build`.")],
    queries: Annotated[
        str,
        typer.Argument(
            help="A folder of images, a pattern, a video, a ROS bag or MCAP file, a camera's number or URL, "
            "or a .npy of images or of descriptors."
        ),
    ],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Write the fixes to this file.")
    ] = None,
    form: Annotated[
        Format | None,
        typer.Option(
            "--format", help="A line a fix, as CSV or JSON; by the file's ending, else CSV."
        ),
    ] = None,
    *,
    options: dict[str, Any],
    screen: Annotated[
        Screen | None,
        typer.Option(
            help="Scan a copy of float32 descriptors in bytes: faster on a large map, the same answers."
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(
            help="A map of `surefix map build --model`: the ONNX file, to describe the images that come."
        ),
    ] = None,
    follow: Annotated[
        bool,
        typer.Option(
            "--follow", help="A folder: go on with what comes, until Ctrl-C.", rich_help_panel=F
        ),
    ] = False,
    idle: Annotated[
        float | None,
        typer.Option(
            min=0,
            help="With --follow: end when none has come for so many seconds.",
            rich_help_panel=F,
        ),
    ] = None,
    topic: Annotated[
        str | None,
        typer.Option(
            help="A bag: the topic of the images, if there are several.", rich_help_panel=F
        ),
    ] = None,
    stride: Annotated[
        int, typer.Option(min=1, help="Take every n-th frame.", rich_help_panel=F)
    ] = 1,
    every: Annotated[
        float | None, typer.Option(help="Take a frame every so many seconds.", rich_help_panel=F)
    ] = None,
    metres: Annotated[
        float | None,
        typer.Option(help="Take a frame every so many metres, by --odometry.", rich_help_panel=F),
    ] = None,
    odometry: Annotated[
        str | None,
        typer.Option(
            help="A .csv with the columns time and x,y[,z] or distance, or a topic of the bag: "
            "Odometry, PoseStamped, PoseWithCovarianceStamped or NavSatFix.",
            rich_help_panel=F,
        ),
    ] = None,
    gap: Annotated[
        float | None,
        typer.Option(
            help="Frames more than so many seconds apart do not follow on each other.",
            rich_help_panel=F,
        ),
    ] = None,
    newest: Annotated[
        bool | None,
        typer.Option(
            help="Where matching is slow, drop frames and go on with the newest; a camera's by default.",
            rich_help_panel=F,
        ),
    ] = None,
    live: Annotated[
        bool,
        typer.Option(
            "--live", help="Open rerun's viewer; without rerun, the terminal's.", rich_help_panel=S
        ),
    ] = False,
    save: Annotated[
        Path | None,
        typer.Option(help="Write a recording, to be opened by rerun FILE.rrd.", rich_help_panel=S),
    ] = None,
    references: Annotated[
        Path | None,
        typer.Option(help="The map's images, to be shown beside the queries.", rich_help_panel=S),
    ] = None,
) -> None:
    """Localize along a route: a fix for each query, as it comes."""
    places = Map.open(route)
    for option, value in (("--every", every), ("--metres", metres), ("--gap", gap)):
        if value is not None and not value > 0:
            raise typer.BadParameter(f"{option}: expected a number above 0, got {value}")
    if (metres is None) != (odometry is None):
        given, lacking = (
            ("--metres", "--odometry") if odometry is None else ("--odometry", "--metres")
        )
        raise typer.BadParameter(f"{given}: expected {lacking} too")
    stream = open_stream(
        queries,
        topic=topic,
        follow=follow,
        idle=idle,
        gap=gap,
        stride=stride,
        every=every,
        metres=metres,
        odometry=odometry,
        newest=newest,
    )
    network = None if model is None else network_of(places, route, model)
    try:
        localizer = Localizer(
            places.with_screen("i8") if screen else places,
            descriptor=network,
            **options,
        )
    except SurefixValueError as error:
        raise typer.BadParameter(str(error)) from None
    if (
        out is not None
        and out.exists()
        and any(out.samefile(file) for file in (route, *_read(stream)))
    ):
        raise typer.BadParameter(f"--out: {out} is what is read here; name another file")
    if save is not None:
        _check_save(save, [*([] if out is None else [out]), route, *_read(stream)])
    tally = Tally()
    with ExitStack() as opened:
        # First, so that a view which cannot be opened leaves the file as it was.
        seen = open_views(places, stream.estimate, live=live, save=save, references=references)
        views = opened.enter_context(seen)
        file = None if out is None else opened.enter_context(_create(out))
        try:
            localize(localizer, stream, _writer(file, _format(form, out)), tally, views)
            tally.ended = True
        except KeyboardInterrupt:
            # What has no end of its own is ended so.
            if not stream.live:
                raise
        finally:
            # What came before a frame that cannot be read is kept, and said, on a terminal that is
            # free again.
            opened.close()
            print(tally.summary(out), file=sys.stderr)


def localize(
    localizer: Localizer,
    stream: Stream,
    writer: Writer | None,
    tally: Tally,
    views: Sequence[View] = (),
) -> None:
    """Push each frame of the stream, write and count each fix, and show it in the views.

    Raises ------ SurefixError As the stream does; and for a frame that the localizer refuses: the
    error names it, and both sizes where images change size there.
    """
    names = localizer.map.names
    before: tuple[int, ...] | None = None
    with closing(stream.frames()) as frames:
        for frame in frames:
            if frame.breaks:
                localizer.gap()
            start = time.perf_counter_ns()
            try:
                fix = localizer.push(frame.image)
            except SurefixValueError as error:
                raise _at(frame, before, error) from None
            latency = (time.perf_counter_ns() - start) / 1000
            before = frame.image.shape
            moment = (
                Moment(frame.time, frame.dropped, frame.gap)
                if stream.timed or stream.live
                else None
            )
            row = FixRow(frame.name, fix, names[fix.place] if names else None, latency, moment)
            if writer is not None:
                writer.write(row)
            tally.add(row)
            for view in views:
                view.update(frame, fix, localizer, latency)


def _at(
    frame: Frame, before: tuple[int, ...] | None, error: SurefixValueError
) -> SurefixValueError:
    """The error, with the frame it is about; where its size is another than that of those before,
    that is why.
    """
    shape = frame.image.shape
    sizes = ""
    if before is not None and shape != before:
        was, now = (" x ".join(map(str, size[1::-1])) for size in (before, shape))
        sizes = f" the images change size here, from {was} to {now}:"
    return SurefixValueError(f"{frame.name}:{sizes} {error}")


def _read(stream: Stream) -> list[Path]:
    return [path for path in map(Path, stream.files) if path.exists()]


def _check_save(save: Path, others: list[Path]) -> None:
    if save.suffix != ".rrd":
        raise typer.BadParameter(f"--save: expected a name that ends in .rrd, got {save}")
    if any(
        save == file or (save.exists() and file.exists() and save.samefile(file)) for file in others
    ):
        raise typer.BadParameter(
            f"--save: {save} is read or written here for something else; name another file"
        )


def _create(out: Path) -> TextIO:
    try:
        return out.open("w", encoding="utf-8", newline="")
    except OSError as error:
        raise SurefixFileError(f"{out}: cannot write the fixes: {error.strerror}") from None


def _format(form: Format | None, out: Path | None) -> Format:
    if form is not None:
        return form
    return (
        Format.json
        if out is not None and out.suffix in (".json", ".jsonl", ".ndjson")
        else Format.csv
    )


def _writer(file: TextIO | None, form: Format) -> Writer | None:
    """What writes the fixes: none where they would run over the view of the terminal."""
    lines = CsvFixes if form is Format.csv else JsonFixes
    if file is not None:
        return lines(file)
    return None if sys.stdout.isatty() else lines(sys.stdout)
