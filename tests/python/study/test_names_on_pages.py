"""A name is text on a page and in its tables: in elements, attributes, scripts and formulas."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import surefix
from commands import surefix_
from surefix import plot
from surefix._words import plain

pytest.importorskip("surefix.report.page", exc_type=ModuleNotFoundError)

# What ends an element, an attribute, a script, a comment or a line, what begins a formula of
# matplotlib or a template, and what a terminal takes as a command. No file's name has a slash.
EVIL = "</script><!--\"'&amp;<b>{{x}}${x}$^_\x1b]0;o\x07\u202e\u2028"
HOSTILE, HARMLESS = EVIL.replace("/", "") + os.fsdecode(b"\xff"), "name"


class Structure(HTMLParser):
    """The elements of a page with their attributes' names, and its text, with that of scripts."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, tuple[str, ...]]] = []
        self.text = ""
        self.data = ""
        self.named: list[tuple[str, str | None]] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, tuple(name for name, _ in attributes)))
        self.named = attributes

    def handle_data(self, text: str) -> None:
        if ("id", "explorer-data") in self.named and self.elements[-1][0] == "script":
            self.data += text
        self.text += text


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The same two drives, with this word in all their names."""
    drawn = np.random.default_rng(0).integers(0, 256, (12, 32, 64), dtype=np.uint8)
    root = tmp_path_factory.mktemp("pages")

    def made(word: str) -> Path:
        top = root / word
        if not top.exists():
            for day, order in (("monday", 1), ("tuesday", -1)):
                (top / f"{day}{word}").mkdir(parents=True)
                for index, pixels in enumerate(drawn[::order]):
                    file = top / f"{day}{word}" / f"{index:02}{word}.pgm"
                    file.write_bytes(b"P5 64 32 255\n" + pixels.tobytes())
            np.save(top / f"one{word}.npy", 1 - np.eye(12, dtype=np.float32))
            np.save(top / f"two{word}.npy", drawn[:, :12, 0] / np.float32(256))
        return top

    return made


# The page that each makes, of the words that begin with a brace.
PAGES = {
    "eval": ["eval", "{monday}", "{tuesday}", "--truth", "identity", "-o", "{out}"],
    "run": ["run", "{monday}", "{tuesday}", "-o", "{out}.csv", "--report", "{page}"],
    "align": ["align", "{monday}", "{tuesday}", "-o", "{out}.csv", "--report", "{out}"],
    "compare": ["compare", "a{word}={one}", "b{word}={two}", "--truth", "identity", "-o", "{page}"],
}  # fmt: skip


def page(command: str, word: str, top: Path, out: Path) -> str:
    """The text of the page that a command makes of the drives with a word in their names."""
    known = {name: top / f"{name}{word}" for name in ("monday", "tuesday")}
    known |= {name: top / f"{name}{word}.npy" for name in ("one", "two")}
    known |= {"out": out / f"report{word}", "page": out / f"page{word}.html"}
    surefix_(*(part.format(word=word, **known) for part in PAGES[command]))
    file = known["page"] if known["page"].is_file() else known["out"] / "report.html"
    return file.read_text(encoding="utf-8")


# On a phone, a name of this length leaves no room for the axes.
@pytest.mark.filterwarnings("ignore:constrained_layout not applied")
@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("command", PAGES)
def test_a_page_has_the_same_elements_whatever_the_names(
    command: str, folder: Callable[[str], Path], tmp_path: Path
) -> None:
    text = page(command, HOSTILE, folder(HOSTILE), tmp_path)
    hostile = Structure(text)
    harmless = Structure(page(command, HARMLESS, folder(HARMLESS), tmp_path))
    assert hostile.elements == harmless.elements
    assert plain(HOSTILE) in hostile.text
    # Control characters are for a terminal that shows the file, too.
    assert not {"\x1b", "\x07", "\u202e", "\u2028"} & {*text}
    for named, word in ((hostile, HOSTILE), (harmless, HARMLESS)):
        if named.data:
            data = json.loads(named.data)
            assert data["queryNames"][3].endswith(
                f"03{plain(word)}.pgm".replace("\\udcff", "\ufffd")
            )


@pytest.mark.usefixtures("undrawn")
def test_the_tables_of_a_report_keep_names_or_quote_formulas(tmp_path: Path) -> None:
    drawn = np.random.default_rng(0).integers(0, 256, (6, 32, 64), dtype=np.uint8)
    signs = ["+SUM(A1)", "-1+1", "=1+1", "@x", "\tx", "plain"]
    (tmp_path / "drive").mkdir()
    for sign, pixels in zip(signs, drawn, strict=True):
        (tmp_path / "drive" / f"{sign}.pgm").write_bytes(b"P5 64 32 255\n" + pixels.tobytes())
    drive = tmp_path / "drive"
    names = surefix.Map.from_images(drive, progress=False).names
    assert names is not None
    assert sorted(names) == sorted(f"{sign}.pgm" for sign in signs)
    quoted = [name if name == "plain.pgm" else f"'{name}" for name in names]

    def cells(file: Path, column: str) -> list[str]:
        with file.open(newline="", encoding="utf-8") as opened:
            return [row[column] for row in csv.DictReader(opened)]

    for flag, expected in (([], names), (["--spreadsheet"], quoted)):
        surefix_("run", drive, drive, "-o", tmp_path / "run.csv", *flag)
        for column in ("query", "place_name"):
            assert cells(tmp_path / "run.csv", column) == expected
        # Numbers are numbers, below zero too.
        assert all(float(cell) < 1e9 for cell in cells(tmp_path / "run.csv", "gradient_value"))
        one = ("--truth", "identity", "--method", "single")
        surefix_("eval", drive, drive, *one, "-o", tmp_path / "report", *flag)
        assert cells(tmp_path / "report" / "fixes.csv", "name") == 2 * expected
        surefix_("loops", drive, "-o", tmp_path / "loops.csv", "--exclude", 1, *flag)
    refused = surefix_("run", drive, drive, "--format", "json", "--spreadsheet", code=2)
    assert "--spreadsheet: expected CSV, got --format json" in " ".join(refused.stderr.split())


def test_a_comparison_keeps_names_or_quotes_formulas(tmp_path: Path) -> None:
    good = surefix.match_distances(1 - np.eye(40, dtype=np.float32))
    found = surefix.compare({"=1+1": good, "-1": good}, np.arange(40))
    for spreadsheet, names in ((False, {"=1+1", "-1"}), (True, {"'=1+1", "'-1"})):
        found.to_csv(tmp_path / "found.csv", spreadsheet=spreadsheet)
        with (tmp_path / "found.csv").open(newline="") as opened:
            rows = [*csv.DictReader(opened)]
        assert {row["run"] for row in rows} == names
        assert all(float(row["difference"]) == 0 for row in rows if row["difference"])


def test_a_name_is_no_formula_in_a_picture() -> None:
    names = ["$\\frac$", "a $x^ b_$"]
    run = surefix.match_distances(1 - np.eye(9, dtype=np.float32))
    curve = surefix.evaluate(run, np.arange(9))
    axes = plot.precision_recall({name: curve for name in names})
    legend = axes.get_legend()
    assert legend is not None
    written = [each.get_text() for each in legend.get_texts()]
    assert all(text.startswith(name) for text, name in zip(written, names, strict=True))
    # A formula that is none would be refused here.
    assert plot.png(axes)
