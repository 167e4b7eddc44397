"""The views of ``surefix run``: on the terminal, in rerun's viewer, in a recording."""

import sys
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

from surefix import Map
from surefix._terminal import Console, say
from surefix.cli.pages import RunPage
from surefix.frames import open as open_frames
from surefix.frames.by_name import UInt8, images_by_name
from surefix.frames.images import Images
from surefix.frames.opening import is_recording
from surefix.frames.recording import is_bag
from surefix.live import RerunView, TerminalView, View
from surefix.live.view import References
from surefix.live.viewer import viewer_obstacle

__all__ = ["leave_room", "open_views"]


def leave_room(views: Iterable[View], said: Iterable[str]) -> None:
    """Lets the last picture on the terminal end above these lines, as they are broken there."""
    for view in views:
        if isinstance(view, TerminalView):
            wide = max(1, view.console.width)
            # An error is said in a line more.
            view.spare = 1 + sum(max(1, -(-len(line) // wide)) for line in said)


@contextmanager
def open_views(
    route: Map,
    total: int | None,
    *,
    live: bool,
    save: Path | None,
    references: tuple[str, str | None] | Images | None,
    report: tuple[Path, str] | None = None,
) -> Iterator[list[View]]:
    """The views that were asked for, and that of the terminal; closed in the end, whatever comes.

    A terminal gets its view if standard output is one. With ``live`` it is enough that standard
    error is one, so that fixes can go into a pipe. If rerun's viewer cannot be opened, a line
    says so, and the terminal has to do. ``references`` are what the map was made of, and its topic;
    or the images of its places; ``report`` is a page to write, and its title.

    Raises
    ------
    SurefixError
        If a recording is asked for and rerun is not installed, or it cannot be written; if
        ``references`` has none of the map's images.
    """
    obstacle = viewer_obstacle() if live else None
    spawn = live and obstacle is None
    terminal = (
        sys.stdout if sys.stdout.isatty() else sys.stderr if live and sys.stderr.isatty() else None
    )
    with ExitStack() as open_:
        views: list[View] = []
        wanted = spawn or any(each is not None for each in (save, terminal, report))
        shown: Any = references
        if isinstance(references, tuple):
            shown = _references(route, *references, wanted)
        if spawn or save is not None:
            rerun = RerunView(route, save, spawn=spawn, references=shown)
            views.append(open_.enter_context(closing(rerun)))
        if report is not None:
            views.append(open_.enter_context(closing(RunPage(*report, route, shown))))
        if obstacle:
            instead = "on the terminal instead"
            if terminal is None:
                instead = "no terminal either, so only the fixes are written"
            say(f"--live: {obstacle} ({instead})", file=sys.stderr)
        if terminal is not None:
            console = Console(file=terminal)
            view = TerminalView(route, total=total, references=shown, console=console)
            views.append(open_.enter_context(closing(view)))
        yield views


def _references(
    route: Map, place: str, topic: str | None, wanted: bool
) -> str | dict[int, UInt8] | None:
    """The folder of the map's images, or the images themselves, of whatever the map is made of; if
    they are not wanted, they are only looked for.
    """
    images = Path(place).is_file() or any(mark in place for mark in "*?[")
    if not (images or is_recording(place)):
        # Refuses another folder.
        References(route, place)
        return place
    frames = open_frames(place, topic=topic if is_bag(place) else None, skip_bad=True)
    return images_by_name(frames, route.names, len(route), place) if wanted else None
