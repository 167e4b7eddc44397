"""The command line: ``surefix``."""

import os
import sys
from typing import Annotated

import typer

from surefix import SurefixError, __version__
from surefix.cli.demo import demo
from surefix.cli.map import build, info
from surefix.cli.run import run

__all__ = ["app", "main"]

# What shells call the end by Ctrl-C.
INTERRUPTED = 130

app = typer.Typer(
    name="surefix",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
    epilog="Start with: surefix demo",
)
maps = typer.Typer(no_args_is_help=True, help="Make a map of a route, or look at one.")
maps.command(epilog="Example: surefix map build photos/ -o route.safetensors")(build)
maps.command(epilog="Example: surefix map info route.safetensors")(info)
app.add_typer(maps, name="map")
app.command(epilog="Example: surefix run route.safetensors todays_photos/ -o fixes.csv")(run)
app.command(epilog="Example: surefix demo --out out/demo")(demo)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"surefix {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Where am I on this route, and may I trust that answer?"""


def main() -> None:
    """Run the command line. Exit codes: 0, 1 (it failed), 2 (bad usage), 130 (Ctrl-C)."""
    try:
        app(prog_name="surefix")
    except SystemExit as end:
        if end.code == INTERRUPTED:
            print("surefix: interrupted", file=sys.stderr)
        raise
    except SurefixError as error:
        print(f"surefix: {error}", file=sys.stderr)
        sys.exit(1)
    except BrokenPipeError:
        # The reader, such as `head`, has seen enough. Python would complain once more when it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
