"""The views of ``surefix run``: on the terminal, in rerun's viewer, in a recording."""

import sys
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

from rich.console import Console

from surefix import Map
from surefix.live import RerunView, TerminalView, View
from surefix.live.viewer import viewer_obstacle

__all__ = ["open_views"]

NARROW = 110


@contextmanager
def open_views(
    route: Map, total: int | None, *, live: bool, save: Path | None, references: Path | None
) -> Iterator[list[View]]:
    """The views that were asked for, and that of the terminal; closed in the end, whatever comes.

    A terminal gets its view if standard output is one. With ``live`` it is enough that standard
    error is one, so that fixes can go into a pipe. If rerun's viewer cannot be opened, a line
    says so, and the terminal has to do.

    Raises
    ------
    SurefixError
        If a recording is asked for and rerun is not installed, or it cannot be written; if
        ``references`` is no folder of the map's images.
    """
    obstacle = viewer_obstacle() if live else None
    spawn = live and obstacle is None
    terminal = (
        sys.stdout if sys.stdout.isatty() else sys.stderr if live and sys.stderr.isatty() else None
    )
    with ExitStack() as open_:
        views: list[View] = []
        if spawn or save is not None:
            rerun = RerunView(route, save, spawn=spawn, references=references)
            views.append(open_.enter_context(closing(rerun)))
        if obstacle:
            instead = "on the terminal instead"
            if terminal is None:
                instead = "no terminal either, so only the fixes are written"
            print(f"--live: {obstacle} ({instead})", file=sys.stderr)
        if terminal is not None:
            console = Console(file=terminal)
            # The summary's lines, which are broken on a narrow terminal.
            spare = 6 if console.width < NARROW else 4
            view = TerminalView(
                route, total=total, references=references, console=console, spare=spare
            )
            views.append(open_.enter_context(closing(view)))
        yield views
