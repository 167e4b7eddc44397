"""The pages of the documentation. Their examples are run in order, and must print the output on the
page.

A block of ``python`` is run, and a block of ``text`` right after it is its output. Each ``$`` line
of a ``console`` block is run by the shell, and the lines after it are its output. In both, ``...``
matches any text. Blocks of ``sh``, such as installations, are not run; cargo runs those of
``rust``. Code in a comment of a page draws its pictures, and is not shown.

A ``NAME.png`` that the examples of ``a/page.md`` write is the picture ``images/page-NAME.png``, and
on dark paper ``images/page-NAME-dark.png``. As a program, this module draws all of them again.
"""

import contextlib
import doctest
import io
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product, zip_longest
from pathlib import Path

from PIL import Image

from surefix.plot import DARK, LIGHT

__all__ = ["DOCS", "IMAGES", "PAGES", "Block", "blocks", "dark_paper", "few_colours", "keep", "run"]

DOCS = Path(__file__).resolve().parent
IMAGES = DOCS / "images"
PAGES = sorted(path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md"))

FENCE = re.compile(r"^```([^\n`]*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
SECONDS = 120


@dataclass(frozen=True)
class Block:
    """A block of code of a page: language, text, first line, and whether it is in a comment."""

    language: str
    text: str
    line: int
    hidden: bool


def blocks(page: str) -> list[Block]:
    """All blocks of a page, in order."""
    text = (DOCS / page).read_text(encoding="utf-8")
    return [
        Block(
            m[1].strip(),
            m[2],
            text.count("\n", 0, m.start()) + 2,
            text[: m.start()].endswith("<!--\n"),
        )
        for m in FENCE.finditer(text)
    ]


def run(page: str, folder: Path) -> dict[str, bytes]:
    """Runs a page's examples, with ``folder`` as the working folder.

    Returns
    -------
    dict
        The pictures that they drew, as PNG, by their names in ``images``.

    Raises
    ------
    AssertionError
        If the output differs from the page; the message names the page and the line.
    """
    names: dict[str, object] = {"__name__": "__main__"}
    with contextlib.chdir(folder):
        for block, expected in _with_output(blocks(page)):
            where = f"{page}:{block.line}"
            if block.language == "python":
                code = "\n" * (block.line - 1) + block.text
                said = io.StringIO()
                with contextlib.redirect_stdout(said):
                    exec(compile(code, str(DOCS / page), "exec"), names)
                if expected is not None:
                    _compare(where, expected, said.getvalue())
            elif block.language == "console":
                for command, shown in _commands(block.text):
                    _compare(f"{where}: {command}", shown, _shell(command))
    return {
        f"{Path(page).stem}-{drawn.name}": drawn.read_bytes()
        for drawn in sorted(folder.glob("*.png"))
    }


@contextlib.contextmanager
def dark_paper() -> Iterator[None]:
    """Examples draw on dark paper: ``LIGHT``, the theme of every figure, has the colours of
    ``DARK`` meanwhile.
    """
    light = dict(vars(LIGHT))
    vars(LIGHT).update(vars(DARK))
    try:
        yield
    finally:
        vars(LIGHT).update(light)


def few_colours(picture: bytes) -> bytes:
    """A PNG of 256 colours, rare ones included: enough, and half the bytes."""
    file = io.BytesIO()
    image = Image.open(io.BytesIO(picture)).convert("RGB")
    image.quantize(256, Image.Quantize.MAXCOVERAGE).save(file, "PNG", optimize=True)
    return file.getvalue()


def keep(picture: bytes, file: Path) -> None:
    """Writes a PNG with few colours."""
    file.write_bytes(few_colours(picture))
    print(f"{file}: {file.stat().st_size / 1000:.0f} kB", file=sys.stderr)


def _with_output(found: list[Block]) -> Iterator[tuple[Block, str | None]]:
    for block, after in zip_longest(found, found[1:]):
        yield block, after.text if after is not None and after.language == "text" else None


def _commands(text: str) -> Iterator[tuple[str, str]]:
    """Each command of a console block, and its output."""
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, _, shown = part.partition("\n")
        while command.endswith("\\"):
            more, _, shown = shown.partition("\n")
            command = command[:-1] + more
        yield command, shown


def _shell(command: str) -> str:
    here = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    environment = {**os.environ, "PATH": here, "COLUMNS": "120"}
    done = subprocess.run(
        ["sh", "-c", command],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    return done.stdout


def _compare(where: str, expected: str, got: str) -> None:
    # Spaces at the ends of lines, as in tables, are invisible on a page.
    expected, got = (re.sub(r"[ ]+$", "", text, flags=re.MULTILINE) for text in (expected, got))
    if not doctest.OutputChecker().check_output(expected, got, doctest.ELLIPSIS):
        raise AssertionError(f"{where}: expected\n{expected}\ngot\n{got}")


if __name__ == "__main__":
    chosen = sys.argv[1:] or PAGES
    drawing = [page for page in chosen if any(".png" in block.text for block in blocks(page))]
    for page, ending in product(drawing, ("", "-dark")):
        paper = dark_paper() if ending else contextlib.nullcontext()
        with paper, tempfile.TemporaryDirectory() as folder:
            for name, drawn in run(page, Path(folder)).items():
                keep(drawn, IMAGES / f"{Path(name).stem}{ending}.png")
