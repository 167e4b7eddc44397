"""Reports of commands: their titles, the page of a run, and the browser."""

import shlex
import sys
import tempfile
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path, PurePath
from typing import Annotated, Any

import typer

from surefix import Fix, Localizer, Map
from surefix._extra import drawing
from surefix._terminal import say
from surefix.errors import mismatch
from surefix.live.view import References, Seen

__all__ = ["Open", "RunPage", "check_page", "page_of", "show", "title_of"]

Open = Annotated[bool, typer.Option("--open", help="Open the report in the browser.")]


def title_of(queries: object, route: object) -> str:
    """The drive and its map, as they were named."""
    named = [_short(str(place)) for place in (queries, route) if place is not None]
    return " on ".join(named)


def _short(place: str) -> str:
    """Of a long path the last two parts."""
    path = PurePath(place)
    return (
        "/".join(path.parts[-2:])
        if path.is_absolute() or len(path.parts) > 3
        else place.rstrip("/")
    )


def check_page(report: Path | None) -> None:
    """Refuses a page that cannot be written."""
    if report is None:
        return
    if report.suffix.lower() not in (".html", ".htm"):
        raise typer.BadParameter(f"--report: expected a name that ends in .html, got {report}")
    if not report.parent.is_dir():
        raise mismatch(f"--report {report}", "a folder that exists", report.parent)


@contextmanager
def page_of(report: Path | None, wanted: bool) -> Iterator[Path | None]:
    """The page to write: for the browser alone, one in a folder of its own, which goes again if
    nothing was written.
    """
    if report is not None or not wanted:
        yield report
        return
    folder = Path(tempfile.mkdtemp(prefix="surefix-"))
    try:
        yield folder / "run.html"
    finally:
        with suppress(OSError):
            folder.rmdir()


def show(page: Path, wanted: bool) -> None:
    """Opens a page in the browser, if that is wanted and there is one."""
    if not wanted:
        return
    try:
        opened = webbrowser.open(page.resolve().as_uri())
    except (webbrowser.Error, OSError):
        opened = False
    if not opened:
        say(f"--open: no browser is known here; open {page}", file=sys.stderr)


class RunPage:
    """A view of ``surefix run`` that becomes a page when it ends; ``references`` are the images of
    the map, as a view takes them.

    Raises
    ------
    SurefixError
        If the libraries of reports are not installed.
    """

    def __init__(self, path: Path, title: str, route: Map, references: Any = None) -> None:
        drawing("the report")
        # Not at the top: Bokeh and matplotlib are extras, and slow to import.
        from surefix.report.run import Recorder

        self.path, self.title, self.references = path, title, references
        self.written = False
        self.recorder = Recorder(route)

    def update(self, frame: Any, fix: Fix, localizer: Localizer, latency_us: float) -> None:
        """Takes a frame and its fix."""
        seen = Seen.of(frame, fix)
        wanted = self.recorder.queries.wants(len(self.recorder))
        self.recorder.add(fix, localizer.distances, seen.name, seen.image if wanted else None)

    def close(self) -> None:
        """Writes the page, if there was a fix."""
        if self.written or not len(self.recorder):
            return
        found = References(self.recorder.map, self.references)
        command = shlex.join(["surefix", *sys.argv[1:]])
        self.recorder.write(self.path, self.title, command, _Places(found) if found else None)
        self.written = True


class _Places:
    """The images of places, by number; a KeyError for a place without one."""

    def __init__(self, references: References) -> None:
        self.references = references

    def __getitem__(self, place: int) -> Any:
        image = self.references.image(place)
        if image is None:
            raise KeyError(place)
        return image
