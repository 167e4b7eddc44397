"""A page of HTML that needs no other file, for light and for dark paper; and its folder."""

import base64
import errno
import io
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

# Pillow comes with matplotlib.
from PIL import Image

from surefix._core import _AtomicFolder
from surefix._words import escaped
from surefix.errors import refusal
from surefix.plot.theme import DARK, LIGHT, Theme, png

__all__ = [
    "PAGE",
    "Picture",
    "Section",
    "Table",
    "Tile",
    "drawn",
    "few_colours",
    "output_folder",
    "page",
    "photograph",
    "write",
]

PAGE = "report.html"
NARROW, DARKER = "(max-width: 640px)", "(prefers-color-scheme: dark)"
THEME = '<button type="button" id="explorer-theme">Light or dark</button>'


@dataclass(frozen=True)
class Tile:
    """A number that a reader should take away. ``name`` becomes the element's id."""

    name: str
    value: str
    label: str
    note: str = ""


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture for light and for dark paper, with a text for readers who cannot see it.

    Attributes
    ----------
    paint : function of a ``Theme``
        Gives the bytes of a PNG file; it is called when the picture is first needed.
    alt, caption : str
    wide : bool
        Takes the page's whole width.
    textured : bool
        Embedded as JPEG, at a fraction of its size.
    narrow : function of a ``Theme``, optional
        Gives the PNG for a page of a phone's width.
    """

    paint: Callable[[Theme], bytes]
    alt: str
    caption: str = ""
    wide: bool = False
    textured: bool = False
    narrow: Callable[[Theme], bytes] | None = None

    @cached_property
    def light(self) -> bytes:
        """On light paper."""
        return self.paint(LIGHT)

    @cached_property
    def dark(self) -> bytes:
        """On dark paper."""
        return self.paint(DARK)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return _size(self.light)


def drawn(
    size: tuple[float, float],
    alt: str,
    draw: Callable[..., object],
    *data: Any,
    caption: str = "",
    textured: bool = False,
    small: bool = False,
    **options: Any,
) -> Picture:
    """``draw(*data, ax=ax, theme=theme, **options)`` as a picture; one wider than 8 inches is wide.

    A ``small`` one has few colours, and a third of the bytes.
    """

    def paint(theme: Theme) -> bytes:
        def on(ax: Axes, theme: Theme) -> object:
            return draw(*data, ax=ax, theme=theme, **options)

        picture = png(on, size=size, theme=theme)
        return few_colours(picture) if small else picture

    return Picture(paint, alt, caption, wide=size[0] > 8, textured=textured)


def few_colours(picture: bytes) -> bytes:
    """A PNG of 128 colours, a third of the bytes."""
    file = io.BytesIO()
    image = Image.open(io.BytesIO(picture)).convert("RGB")
    image.quantize(128, dither=Image.Dither.NONE).save(file, "PNG", optimize=True)
    return file.getvalue()


def photograph(image: NDArray[np.uint8], alt: str, caption: str) -> Picture:
    """A camera image as it is, the same on any paper."""
    file = io.BytesIO()
    Image.fromarray(image).save(file, "PNG")
    return Picture(lambda theme: file.getvalue(), alt, caption, textured=True)


@dataclass(frozen=True)
class Table:
    """Numbers with a heading a column; a row's first cell names it. ``name`` becomes the id. If it
    ``sorts``, a press on a heading sorts the rows by that column. ``shows`` has the method and the
    query of each row, for a button that shows them on the page.
    """

    name: str
    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    sorts: bool = False
    shows: Sequence[tuple[str, int]] = ()


@dataclass(frozen=True)
class Section:
    """A heading, some paragraphs, pictures below them, side by side if there is room, and tables.
    The pictures go by the names of their files. ``html`` is markup, all others are plain text.
    """

    title: str
    paragraphs: Sequence[str]
    pictures: Mapping[str, Picture] = field(default_factory=dict)
    facts: Sequence[tuple[str, str]] = ()
    tables: Sequence[Table] = ()
    points: Sequence[str] = ()
    html: str = ""


def page(
    title: str,
    lead: Sequence[str],
    hero: Sequence[Picture],
    tiles: Sequence[Tile],
    sections: Sequence[Section],
    *,
    contents: bool = False,
    identity: str = "",
    command: str = "",
    scripts: str = "",
) -> str:
    """The page as text. All strings are plain text; they are escaped here, except ``scripts``, the
    elements at its end. With ``contents``, links to the sections come first. ``identity`` is the
    line above the title, ``command`` made the page.
    """
    style = _part("page.css") + (_part("contents.css") if contents else "")
    parts = "".join(_section(each, contents) for each in sections)
    sorting = any(table.sorts for section in sections for table in section.tables)
    switch = THEME if scripts else ""
    scripts += f"<script>\n{_part('sort.js')}</script>\n" if sorting else ""
    paragraphs = "\n".join(f'<p class="lead">{escaped(text)}</p>' for text in lead)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{escaped(f"{title} - {identity}" if identity else title)}</title>
<style>
{style}</style>
</head>
<body>
<main>
<header>
{switch}
{f'<p class="identity">{escaped(identity)}</p>' if identity else ""}
<h1>{escaped(title)}</h1>
{f'<p class="command"><code>{_words(command)}</code></p>' if command else ""}
{paragraphs}
</header>
{_pictures(hero, "hero") if hero else ""}
{f'<dl class="tiles">{"".join(map(_tile, tiles))}</dl>' if tiles else ""}
{_contents(sections) if contents else ""}{parts}</main>
{scripts}</body>
</html>
"""


def _words(command: str) -> str:
    """Its words, none of which is broken at a hyphen if it fits into a line."""
    return " ".join(f"<span>{escaped(word)}</span>" for word in command.split(" "))


def _part(name: str) -> str:
    return files("surefix.report").joinpath(name).read_text(encoding="utf-8")


def _contents(sections: Sequence[Section]) -> str:
    links = "".join(
        f'<li><a href="#{_id(each)}">{escaped(each.title)}</a></li>\n' for each in sections
    )
    return f'<nav aria-label="Contents">\n<ol>\n{links}</ol>\n</nav>\n'


def _id(section: Section) -> str:
    """The section's element, by its title."""
    return "section-" + re.sub(r"[^a-z0-9]+", "-", section.title.lower()).strip("-")


def _tile(tile: Tile) -> str:
    note = f'<span class="note">{escaped(tile.note)}</span>' if tile.note else ""
    return (
        f'<div class="tile"><dt>{escaped(tile.label)}</dt>'
        f'<dd><span class="value" id="{escaped(tile.name)}">{escaped(tile.value)}</span>{note}</dd>'
        "</div>\n"
    )


def _section(section: Section, linked: bool) -> str:
    paragraphs = "\n".join(f"<p>{escaped(text)}</p>" for text in section.paragraphs)
    pictures = _pictures(section.pictures.values(), "pictures") if section.pictures else ""
    points = "".join(f"<li>{escaped(text)}</li>\n" for text in section.points)
    points = f"<ul>\n{points}</ul>\n" if points else ""
    tables = "".join(map(_table, section.tables))
    if section.facts:
        tables += f"<table>\n{_body(section.facts)}</table>\n"
    title = escaped(section.title)
    inside = f"<h2>{title}</h2>\n{paragraphs}\n{points}{section.html}{pictures}{tables}"
    at = f' id="{_id(section)}"' if linked else ""
    return f"<section{at}>\n{inside}</section>\n"


def _pictures(pictures: Iterable[Picture], kind: str) -> str:
    return f'<div class="{kind}">\n{"".join(map(_picture, pictures))}</div>\n'


def _picture(picture: Picture) -> str:
    caption = f"<figcaption>{escaped(picture.caption)}</figcaption>" if picture.caption else ""
    width, height = picture.size
    sources = ""
    if picture.narrow is not None:
        light, dark = picture.narrow(LIGHT), picture.narrow(DARK)
        sources += _source(dark, picture.textured, f"{NARROW} and {DARKER}")
        sources += _source(light, picture.textured, NARROW)
    if picture.dark != picture.light:
        sources += _source(picture.dark, picture.textured, DARKER)
    source = _embedded(picture.light, picture.textured)
    image = f'<img src="{source}" alt="{escaped(picture.alt)}" width="{width}" height="{height}">'
    kind = "wide" if picture.wide else "plain"
    kind += " fits" if picture.narrow is not None else ""
    return (
        f'<figure class="{kind}"><div class="frame">'
        f"<picture>{sources}{image}</picture></div>{caption}</figure>\n"
    )


def _source(image: bytes, textured: bool, media: str) -> str:
    width, height = _size(image)
    at = f'srcset="{_embedded(image, textured)}" width="{width}" height="{height}"'
    return f'<source media="{media}" {at}>'


def _size(image: bytes) -> tuple[int, int]:
    """Width and height in the header of a PNG."""
    return int.from_bytes(image[16:20]), int.from_bytes(image[20:24])


def _body(rows: Sequence[Sequence[str]], shows: Sequence[tuple[str, int]] = ()) -> str:
    """The rows of a table; the first cell names its row."""
    buttons = [
        f' <button type="button" data-method="{escaped(method)}" data-query="{query}">show</button>'
        for method, query in shows
    ] or [""] * len(rows)
    cells = (
        f'<th scope="row">{escaped(name)}{button}</th>'
        + "".join(f"<td>{escaped(cell)}</td>" for cell in others)
        for (name, *others), button in zip(rows, buttons, strict=True)
    )
    lines = "".join(f"<tr>{row}</tr>\n" for row in cells)
    return f"<tbody>\n{lines}</tbody>\n"


def _table(table: Table) -> str:
    kind = ' class="sorts"' if table.sorts else ""
    header = "".join(f'<th scope="col">{escaped(name)}</th>' for name in table.header)
    return (
        f'<div class="numbers"><table id="{escaped(table.name)}"{kind}>\n'
        f"<caption><span>{escaped(table.caption)}</span></caption>\n"
        f"<thead>\n<tr>{header}</tr>\n</thead>\n{_body(table.rows, table.shows)}</table></div>\n"
    )


def _embedded(image: bytes, textured: bool) -> str:
    kind = "png"
    if textured:
        file = io.BytesIO()
        Image.open(io.BytesIO(image)).convert("RGB").save(file, "JPEG", quality=88, subsampling=0)
        kind, image = "jpeg", file.getvalue()
    return f"data:image/{kind};base64,{base64.b64encode(image).decode('ascii')}"


def write(
    folder: Path,
    title: str,
    lead: Sequence[str],
    hero: Sequence[Picture],
    tiles: Sequence[Tile],
    sections: Sequence[Section],
    tables: Callable[[Path], object],
    old: Iterable[str] = (),
    *,
    files: Mapping[str, Picture] | None = None,
    **more: Any,
) -> Path:
    """Writes a page, its pictures on light paper, and its tables; returns the path of the page.

    All files come to the folder at once, in place of an earlier report: whenever it is stopped,
    there is the old report or the new one. If the folder has other files, they stay, and those of
    the report are replaced one by one, each whole; the page, which needs no other file, is the
    last.

    Parameters
    ----------
    folder : Path
    title, lead, hero, tiles, sections
        As for ``page``.
    tables : function of a folder
        Writes the other files into it.
    old : iterable of str
        Names of files that an earlier report may have and this one lacks. All others stay.
    files : dict of Picture
        Pictures that are files alone, and not on the page.
    more
        As for ``page``.

    Raises
    ------
    SurefixFileError
        If a file cannot be written.
    """
    text = page(title, lead, hero, tiles, sections, **more)
    pictures = dict(files or {})
    for section in sections:
        pictures |= section.pictures
    # They are drawn before anything is written.
    drawings = {name: picture.light for name, picture in pictures.items()}
    try:
        new = _AtomicFolder(folder)
        try:
            tables(new.path)
            for name, drawing in drawings.items():
                (new.path / name).write_bytes(drawing)
            (new.path / PAGE).write_text(text, encoding="utf-8")
            new.commit([*old], PAGE)
        finally:
            new.discard()
    except OSError as error:
        raise refusal(folder, "cannot write the report", error) from None
    return folder / PAGE


def output_folder(folder: Path) -> None:
    """Refuses a folder that cannot be made or written, before the slow part of a command. It makes
    none: if the command is stopped, no empty one is left.

    Raises
    ------
    SurefixFileError
        If there is a file of its name, or the folder that is there or above may not be written.
    """
    whole = folder.absolute()
    there = next(each for each in (whole, *whole.parents) if each.exists())
    code = errno.EACCES
    if not there.is_dir():
        code = errno.EEXIST if there == whole else errno.ENOTDIR
    elif os.access(there, os.W_OK | os.X_OK):
        return
    error = OSError(code, os.strerror(code))
    raise refusal(folder, "cannot make the output folder", error)
