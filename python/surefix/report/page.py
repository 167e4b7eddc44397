"""One page of HTML that needs no other file: pictures inside, light and dark, on a desk and on a
phone.
"""

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files

# Pillow comes with matplotlib.
from PIL import Image

__all__ = ["Picture", "Section", "Table", "Tile", "page"]


@dataclass(frozen=True)
class Tile:
    """A number that a reader should take away. ``name`` becomes the element's id."""

    name: str
    value: str
    label: str
    note: str = ""


@dataclass(frozen=True)
class Picture:
    """A picture as PNG bytes, on light and on dark paper, and what it shows for those who cannot
    see it.

    A ``textured`` one is embedded as JPEG, at a fraction of its size.
    """

    light: bytes
    dark: bytes
    alt: str
    caption: str = ""
    wide: bool = False
    textured: bool = False

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels, from the header of the PNG."""
        return int.from_bytes(self.light[16:20]), int.from_bytes(self.light[20:24])


@dataclass(frozen=True)
class Table:
    """Numbers with a heading for each column; the first cell of a row names it. ``name`` becomes
    the element's id.
    """

    name: str
    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]

    def __post_init__(self) -> None:
        assert all(len(row) == len(self.header) for row in self.rows), self.name


@dataclass(frozen=True)
class Section:
    """A heading, some paragraphs, pictures below them, side by side where there is room, and
    tables.
    """

    title: str
    paragraphs: Sequence[str]
    pictures: Sequence[Picture] = ()
    rows: Sequence[tuple[str, str]] = ()
    tables: Sequence[Table] = ()
    points: Sequence[str] = ()


def page(
    title: str,
    lead: Sequence[str],
    hero: Sequence[Picture],
    tiles: Sequence[Tile],
    sections: Sequence[Section],
) -> str:
    """The page as text. All strings are plain text; they are escaped here."""
    style = files("surefix.report").joinpath("page.css").read_text(encoding="utf-8")
    paragraphs = "\n".join(f'<p class="lead">{escape(text)}</p>' for text in lead)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{escape(title)}</title>
<style>
{style}</style>
</head>
<body>
<main>
<header>
<h1>{escape(title)}</h1>
{paragraphs}
</header>
{_pictures(hero, "hero") if hero else ""}
<dl class="tiles">
{"".join(map(_tile, tiles))}</dl>
{"".join(map(_section, sections))}</main>
</body>
</html>
"""


def _tile(tile: Tile) -> str:
    note = f'<span class="note">{escape(tile.note)}</span>' if tile.note else ""
    return (
        f'<div class="tile"><dt>{escape(tile.label)}</dt>'
        f'<dd><span class="value" id="{escape(tile.name)}">{escape(tile.value)}</span>{note}</dd></div>\n'
    )


def _section(section: Section) -> str:
    paragraphs = "\n".join(f"<p>{escape(text)}</p>" for text in section.paragraphs)
    pictures = _pictures(section.pictures, "pictures") if section.pictures else ""
    points = "".join(f"<li>{escape(text)}</li>\n" for text in section.points)
    points = f"<ul>\n{points}</ul>\n" if points else ""
    tables = "".join(map(_numbers, section.tables)) + _table(section.rows)
    return f"<section>\n<h2>{escape(section.title)}</h2>\n{paragraphs}\n{points}{pictures}{tables}</section>\n"


def _pictures(pictures: Sequence[Picture], kind: str) -> str:
    return f'<div class="{kind}">\n{"".join(map(_picture, pictures))}</div>\n'


def _picture(picture: Picture) -> str:
    caption = f"<figcaption>{escape(picture.caption)}</figcaption>" if picture.caption else ""
    width, height = picture.size
    dark = ""
    if picture.dark != picture.light:
        source = _embedded(picture.dark, picture.textured)
        dark = f'<source media="(prefers-color-scheme: dark)" srcset="{source}">'
    source = _embedded(picture.light, picture.textured)
    image = f'<img src="{source}" alt="{escape(picture.alt)}" width="{width}" height="{height}">'
    return (
        f'<figure class="{"wide" if picture.wide else "plain"}"><div class="frame">'
        f"<picture>{dark}{image}</picture></div>{caption}</figure>\n"
    )


def _table(rows: Sequence[tuple[str, str]]) -> str:
    if not rows:
        return ""
    body = "".join(
        f'<tr><th scope="row">{escape(name)}</th><td>{escape(value)}</td></tr>\n'
        for name, value in rows
    )
    return f"<table>\n<tbody>\n{body}</tbody>\n</table>\n"


def _numbers(table: Table) -> str:
    header = "".join(f'<th scope="col">{escape(name)}</th>' for name in table.header)
    body = "".join(
        f'<tr><th scope="row">{escape(row[0])}</th>{"".join(f"<td>{escape(cell)}</td>" for cell in row[1:])}</tr>\n'
        for row in table.rows
    )
    return (
        f'<div class="numbers"><table id="{escape(table.name)}">\n<caption>{escape(table.caption)}</caption>\n'
        f"<thead>\n<tr>{header}</tr>\n</thead>\n<tbody>\n{body}</tbody>\n</table></div>\n"
    )


def _embedded(image: bytes, textured: bool) -> str:
    kind = "png"
    if textured:
        file = io.BytesIO()
        Image.open(io.BytesIO(image)).convert("RGB").save(file, "JPEG", quality=88, subsampling=0)
        kind, image = "jpeg", file.getvalue()
    return f"data:image/{kind};base64,{base64.b64encode(image).decode('ascii')}"
