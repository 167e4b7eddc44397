"""The command line: ``surefix``."""

import io
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from surefix import SurefixError, __version__
from surefix._terminal import fitted, say
from surefix._words import plain
from surefix.cli.align import align_
from surefix.cli.audit import audit_
from surefix.cli.bench import bench
from surefix.cli.compare import compare_
from surefix.cli.demo import demo
from surefix.cli.doctor import doctor
from surefix.cli.edit import cut, join, thin, traverse
from surefix.cli.eval import eval_
from surefix.cli.flags import documented, in_flags
from surefix.cli.info import info
from surefix.cli.loops import loops
from surefix.cli.map import append, build
from surefix.cli.models import models
from surefix.cli.reproduce import reproduce
from surefix.cli.run import run
from surefix.cli.study import study_
from surefix.cli.tune import tune_
from surefix.machine import in_gb, limits_left

__all__ = ["app", "main"]

# What shells call the end by Ctrl-C.
INTERRUPTED = 130

# The commands in the order in which one needs them, under their headings in the help.
PANELS = {
    "Localize": ("demo", "map", "run"),
    "Judge and choose": ("eval", "align", "audit", "tune", "compare", "study"),
    "More": ("loops", "models", "reproduce", "bench", "doctor"),
}


class Ordered(TyperGroup):
    """The commands as ``PANELS`` has them."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        named = {name: panel for panel, names in PANELS.items() for name in names}
        known: dict[str, Any] = {
            name: self.commands[name] for name in named if name in self.commands
        }
        self.commands = {**known, **self.commands}
        for name, command in known.items():
            command.rich_help_panel = named[name]

    def make_context(self, *given: Any, **more: Any) -> Any:
        """Reads the words before the command's name."""
        with readable():
            return super().make_context(*given, **more)

    def invoke(self, ctx: Any) -> Any:
        """Runs the command."""
        with readable():
            return super().invoke(ctx)


@contextmanager
def readable() -> Iterator[None]:
    """An option that is refused has its flag's name in the error, and is shown as plain text."""
    try:
        yield
    except typer.TyperException as error:
        if isinstance(error, typer.BadParameter):
            error.message = in_flags(error.message, error.ctx)
        if isinstance(message := getattr(error, "message", None), str):
            error.message = plain(message)
        raise


app = typer.Typer(
    name="surefix",
    cls=Ordered,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    epilog="Start with: surefix demo\n\nExample: surefix run monday/ tuesday/",
    context_settings={"help_option_names": ["-h", "--help"]},
)
maps = typer.Typer(
    no_args_is_help=True,
    help="Make a map of a route, look at one, and change it: longer, shorter, joined.",
    short_help="Make a map of a route, look at one, change it.",
)
maps.command(
    epilog="Example: surefix map build photos/ -o route.safetensors\n\n"
    "Example: surefix map build survey.bag --metres 2 --odometry /odom -o route.safetensors"
)(build)
maps.command(epilog="Example: surefix map append route.safetensors more_photos/")(append)
maps.command(
    epilog="Example: surefix map info route.safetensors\n\n"
    "Example: surefix map info route.safetensors --geojson route.geojson"
)(info)
maps.command(
    epilog="Example: surefix map join north.safetensors ring.safetensors -o town.safetensors "
    "--link-within 10"
)(join)
maps.command(epilog="Example: surefix map cut route.safetensors 0:300 -o lap.safetensors")(cut)
maps.command(epilog="Example: surefix map thin route.safetensors --metres 2 -o thin.safetensors")(
    thin
)
maps.command(
    epilog="Example: surefix map traverse route.safetensors winter.mp4 --every 0.5 "
    "-o both.safetensors\n\nExample: surefix map traverse both.safetensors --remove 1"
)(traverse)
app.add_typer(maps, name="map")
app.command(
    epilog="Example: surefix run monday/ tuesday/ --model megaloc\n\n"
    "Example: surefix run route.safetensors todays_photos/ -o fixes.csv\n\n"
    "Example: surefix run route.safetensors drive.mp4 --every 0.5 --gap 2\n\n"
    "Example: surefix run route.safetensors drive.bag --topic /camera/image --metres 3 "
    "--odometry /odom"
)(run)
app.command(
    "align",
    epilog="Example: surefix align route.safetensors todays_photos/ -o truth.csv\n\n"
    "Example: surefix eval route.safetensors todays_photos/ --truth truth.csv\n\n"
    "Example: surefix align sad.npy --fuse netvlad.npy --report page/ -o truth.csv",
    short_help="Align a recorded drive with a route: a truth without labels.",
)(align_)
app.command(
    epilog="Example: surefix loops todays_photos/ -o loops.csv\n\n"
    "Example: surefix loops drive.bag --every 0.5 --exclude 60 -o loops.g2o",
    short_help="Close loops on a drive without a map.",
)(loops)
app.command(
    "audit",
    epilog="Example: surefix audit monday/ tuesday/ --motion steady\n\n"
    "Example: surefix audit sad.npy --fuse netvlad.npy --accept 0.95",
    short_help="Estimate how often techniques are right, without a truth.",
)(audit_)
app.command(
    "tune",
    epilog="Example: surefix tune route.safetensors photos/tuesday -o route.toml\n\n"
    "Example: surefix tune route.safetensors drive.mp4 --every 0.5 --query-positions gps.csv "
    "--tolerance 10 --wrong 0.01\n\n"
    "Example: surefix run route.safetensors photos/wednesday --config route.toml",
    short_help="Choose settings and a threshold on a recorded drive.",
)(tune_)
app.command(
    "eval",
    epilog="Example: surefix eval monday/ tuesday/ --truth identity -o report/\n\n"
    "Example: surefix eval route.safetensors drive.mp4 --every 0.5 --query-positions gps.csv "
    "--tolerance 10",
    short_help="Compare methods on a drive whose truth is known, in a report.",
)(eval_)
app.command(
    epilog="Example: surefix models\n\n"
    "Example: surefix map build photos/ --model megaloc -o route.safetensors",
    short_help="List the networks that --model takes by name.",
)(models)
app.command(
    "compare",
    epilog="Example: surefix compare monday_report/ tuesday_report/ -o compared.html\n\n"
    "Example: surefix compare sad.safetensors netvlad.safetensors --queries todays_photos/ "
    "--truth identity",
    short_help="Compare reports, runs, methods or descriptors in one table.",
)(compare_)
app.command(
    "study",
    epilog="Example: surefix study study.toml -o results/\n\n"
    "Example: surefix study study.toml -o results/ --ray",
    short_help="Evaluate many settings, descriptors and routes: one table.",
)(study_)
app.command(
    epilog="Example: surefix reproduce --data data/ -o report/",
    short_help="Make the paper's table and figures again, on your data.",
)(reproduce)
app.command(
    epilog="Example: surefix bench route.safetensors --threads 2\n\n"
    "Example: surefix bench --places 100000 --dim 4096 --dtype f32"
)(bench)
app.command(
    epilog="Example: surefix demo --out out/demo\n\nExample: surefix demo --town",
    short_help="See it work, without any data.",
)(demo)
app.command(
    epilog="Example: surefix doctor\n\nExample: surefix doctor --json",
    short_help="Say what is installed here, and whether it works.",
)(doctor)


def _version(wanted: bool) -> None:
    if wanted:
        say(f"surefix {__version__}")
        raise typer.Exit


@app.callback()
@documented
def _root(
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True)] = False,
) -> None:
    """Where am I on this route, and may I trust that answer?

    Parameters
    ----------
    version: Show the version and exit.
    """


def main() -> None:
    """Run the command line. Exit codes: 0, 1 (it failed), 2 (bad usage), 130 (Ctrl-C, or it was
    told to end).
    """
    _prepare_streams()
    try:
        try:
            with _signals():
                app(prog_name="surefix")
        finally:
            sys.stdout.flush()
    except SystemExit as end:
        if end.code == INTERRUPTED:
            say("surefix: interrupted", file=sys.stderr)
        raise
    except SurefixError as error:
        say(*fitted(f"surefix: {error}", sys.stderr), file=sys.stderr)
        sys.exit(1)
    except MemoryError as error:
        # NumPy names the array that it could not have; its address space may be what is limited.
        asked = str(error) or "there is not enough memory"
        limits = ", ".join(f"{in_gb(max(free, 0))} are {whose}" for free, whose in limits_left())
        say(
            f"surefix: {asked[0].lower()}{asked[1:]}; {limits or 'no limit is known'}",
            file=sys.stderr,
        )
        sys.exit(1)
    except OSError as error:
        # A reader such as `head` has seen enough; any other refusal, such as a full disk, is said.
        if not isinstance(error, BrokenPipeError):
            say(f"surefix: cannot write: {error.strerror or error}", file=sys.stderr)
        # Python would complain once more when it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)


@contextmanager
def _signals() -> Iterator[None]:
    """A terminal that closes and a system that stops the program end it as Ctrl-C does: what is
    written so far is kept or cleared away.
    """
    numbers = [getattr(signal, name, None) for name in ("SIGTERM", "SIGHUP")]
    ours = [each for each in numbers if each and signal.getsignal(each) == signal.SIG_DFL]
    if threading.current_thread() is not threading.main_thread():
        ours = []
    for number in ours:
        signal.signal(number, signal.default_int_handler)
    try:
        yield
    finally:
        for number in ours:
            signal.signal(number, signal.SIG_DFL)


def _prepare_streams() -> None:
    """A closed stream swallows all writes; a name that the stream's encoding lacks is escaped."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115 (open until the process ends)
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
