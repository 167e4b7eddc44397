"""Names are text, whatever is in them: no door of the command line lets a control character out."""

from __future__ import annotations

import io
import re
import sys
import unicodedata
from pathlib import Path

import numpy as np
import pytest
import rich.console
from rich.table import Table
from rich.text import Text

import surefix
from commands import surefix_
from surefix._terminal import Console, fitted, say
from surefix._words import plain
from surefix.live import TerminalView

# Titles, colours, cursors, lines, tabs, directions; Rich's markup, HTML, formulas of matplotlib.
WORD = "\x1b]0;owned\x07\x1b[2J\x9b31m\x7f\x00\n\r\t\x85\u202e\u2066\u2029\ud83d</b>&'\"$^_{$"
# As files can be called, and places that hold no pattern.
PLACE = WORD.replace("/", "").replace("\x00", "").replace("\ud83d", "\udcff")
NAME = f"{PLACE}[b][red]"
SHOWN = r"\x1b]0;owned\x07\x1b[2J\x9b31m\x7f\n\r\t\x85\u202e\u2066\u2029"


def controls(text: str) -> set[str]:
    """All that a terminal could take as a command; lines may end."""
    bad = {each for each in text if unicodedata.category(each) in ("Cc", "Cs", "Zl", "Zp")}
    return (
        bad
        | {each for each in text if "\u202a" <= each <= "\u202e" or "\u2066" <= each <= "\u2069"}
    ) - {"\n"}


def test_the_rule_is_that_of_rust() -> None:
    every = "".join(map(chr, range(1, sys.maxunicode + 1))).replace("/", "")
    every = re.sub("[\ud800-\udfff]", "", every)
    with pytest.raises(surefix.SurefixFileError) as refused:
        surefix.Map.open(f"/nowhere/{every}")
    [message] = refused.value.args
    assert message.startswith(f"/nowhere/{plain(every)}: cannot read the map: ")
    assert not controls(message)
    assert "\n" not in message


def test_a_text_is_escaped_once() -> None:
    assert plain(WORD).startswith(
        r"\x1b]0;owned\x07\x1b[2J\x9b31m\x7f\x00\n\r\t\x85\u202e\u2066\u2029\ud83d</b>"
    )
    assert plain(plain(WORD)) == plain(WORD)
    ordinary = "Straße 東京 👩‍👩‍👧 é 100 % \\n C:\\route"
    assert plain(ordinary) == ordinary
    for error in (surefix.SurefixError, surefix.SurefixValueError, surefix.SurefixFileError):
        assert str(error(WORD)) == plain(WORD)


def test_a_line_that_is_said_is_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    say(WORD, "", 3)
    say()
    assert capsys.readouterr().out == f"{plain(WORD)}\n\n3\n\n"
    assert fitted(WORD, io.StringIO()) == [plain(WORD)]


@pytest.mark.parametrize("terminal", [False, True])
def test_a_table_holds_text(terminal: bool) -> None:
    file = io.StringIO()
    colours = "truecolor" if terminal else None
    console = Console(file=file, force_terminal=terminal, width=400, color_system=colours)
    table = Table(WORD, width=300)
    table.add_row(NAME)
    table.add_row(Text(NAME, "red"))
    console.print(table)
    console.print(NAME, soft_wrap=True)
    console.print(Text(NAME))
    with console.status(Text(NAME)):
        pass
    written = file.getvalue()
    # Of Rich's own: colours, the cursor, lines of a table.
    own = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", written) if terminal else written
    assert not controls(own.replace("\r", ""))
    assert "[b][red]" in own
    assert own.count("]0;owned") >= 5
    assert ("\x1b[31m" in written) == terminal


@pytest.mark.parametrize("terminal", [False, True])
def test_a_drive_on_the_terminal(terminal: bool) -> None:
    file = io.StringIO()
    # The caller's console, too.
    console = rich.console.Console(file=file, force_terminal=terminal, width=120, height=40)
    route = surefix.Map.from_descriptors(
        np.eye(4, dtype=np.float32), names=[NAME.replace("\udcff", "")] * 4
    )
    localizer = surefix.Localizer(route)
    row = np.eye(4, dtype=np.float32)[1]
    with TerminalView(route, console=console) as view:
        frame = surefix.frames.Frame(row, None, NAME)
        view.update(frame, localizer.push(row), localizer, 12.0)
    own = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", file.getvalue())
    assert r"\x1b]0;owned\x07" in own
    assert not controls(own.replace("\r", ""))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Images, descriptors, a map, distances, settings and a truth, all with a hostile name."""
    folder = tmp_path_factory.mktemp("plain") / PLACE
    images = folder / f"{PLACE}images"
    images.mkdir(parents=True)
    rng = np.random.default_rng(0)
    drawn = rng.integers(0, 256, (12, 32, 64), dtype=np.uint8)
    for index, pixels in enumerate(drawn):
        image = b"P5 64 32 255\n" + pixels.tobytes()
        (images / f"{index:02}{NAME}.pgm").write_bytes(image)
    vectors = rng.normal(size=(12, 16)).astype(np.float32)
    np.save(folder / f"{PLACE}.npy", vectors)
    np.save(folder / f"{PLACE}D.npy", 1 - np.eye(12, dtype=np.float32))
    surefix.Map.from_images(images, progress=False).save(folder / f"{PLACE}.safetensors")
    (folder / f"{PLACE}.toml").write_text("[config]\n\x1b[31m = 1\n")
    (folder / f"{PLACE}.csv").write_text("query,reference\n0,\x1b]0;owned\x07\n")
    return folder


# Commands, each with a name of the folder's, and what it ends with.
DOORS: dict[str, tuple[list[str], int]] = {
    "map build": (["map", "build", "{images}", "-o", "{new}.safetensors"], 0),
    "map info": (["map", "info", "{map}"], 0),
    "map info of nothing": (["map", "info", "{none}"], 1),
    "map info of a settings file": (["map", "info", "{toml}"], 1),
    "map append": (["map", "append", "{map}", "{vectors}"], 1),
    "map join": (["map", "join", "{map}", "{map}", "-o", "{new}j.safetensors"], 0),
    "map cut": (["map", "cut", "{map}", "0:{none}", "-o", "{new}"], 2),
    "map thin": (["map", "thin", "{map}", "--metres", "2", "-o", "{new}.safetensors"], 2),
    "run": (["run", "{map}", "{images}", "-o", "{new}.csv"], 0),
    "run on two folders": (["run", "{images}", "{images}", "--save-map", "{new}r.safetensors", "-o", "{new}.csv"], 0),
    "run of nothing": (["run", "{map}", "{none}"], 1),
    "run of a csv": (["run", "{map}", "{csv}"], 1),
    "run into no folder": (["run", "{map}", "{images}", "-o", "{none}/fixes.csv"], 1),
    "run --config": (["run", "{map}", "{images}", "--config", "{toml}"], 2),
    "run --odometry": (["run", "{map}", "{images}", "--metres", "1", "--odometry", "{csv}"], 1),
    "run --motion": (["run", "{map}", "{images}", "--motion", "{none}"], 2),
    "run --speeds": (["run", "{map}", "{images}", "--speeds", "{none}"], 2),
    "run --model": (["run", "{images}", "{images}", "--model", "{none}"], 2),
    "eval": (["eval", "{map}", "{images}", "--truth", "{none}"], 1),
    "eval --truth": (["eval", "{map}", "{images}", "--truth", "{csv}", "-o", "{new}"], 1),
    "eval --method": (["eval", "{map}", "{images}", "--truth", "identity", "--method", "{none}"], 2),
    "align": (["align", "{map}", "{images}", "-o", "{new}a.csv"], 0),
    "align of nothing": (["align", "{none}", "{images}", "-o", "{new}a.csv"], 1),
    "audit": (["audit", "{images}", "{none}"], 1),
    "tune": (["tune", "{map}", "{images}", "-o", "{none}/route.toml"], 1),
    "loops": (["loops", "{images}", "-o", "{new}l.csv", "--exclude", "2"], 0),
    "loops of nothing": (["loops", "{none}"], 1),
    "compare": (["compare", "{none}=x", "{none}"], 2),
    "compare distances": (["compare", "{none}={D}", "again={D}", "--truth", "identity", "-o", "{new}.csv"], 0),
    "compare --against": (["compare", "a={D}", "b={D}", "--truth", "identity", "--against", "{none}"], 2),
    "reproduce": (["reproduce", "--data", "{none}", "-o", "{new}"], 1),
    "demo": (["demo", "--out", "{map}"], 1),
    "bench": (["bench", "{none}"], 1),
    "an unknown option": (["run", "--{none}"], 2),
    "an unknown option before the command": (["--{none}"], 2),
    "an unknown command": (["{none}"], 2),
}  # fmt: skip


@pytest.mark.parametrize("door", DOORS)
def test_no_command_lets_a_control_character_out(door: str, folder: Path, tmp_path: Path) -> None:
    words, code = DOORS[door]
    known = {
        "images": folder / f"{PLACE}images",
        "map": folder / f"{PLACE}.safetensors",
        "vectors": folder / f"{PLACE}.npy",
        "D": folder / f"{PLACE}D.npy",
        "toml": folder / f"{PLACE}.toml",
        "csv": folder / f"{PLACE}.csv",
        "new": tmp_path / PLACE,
        "none": f"none{PLACE}",
    }
    done = surefix_(*(word.format(**known) for word in words), code=None)
    said = done.stdout + done.stderr
    assert not controls(said), said
    # In a frame of fewer columns, the name is broken into lines.
    assert "]0;owned" in re.sub(r"[\s│]", "", said), said
    assert done.returncode == code, said


def test_json_is_json(folder: Path) -> None:
    done = surefix_("map", "info", folder / f"{PLACE}.safetensors", "--json")
    assert r"\u001b]0;owned\u0007" in done.stdout
    assert not controls(done.stdout)


def test_the_environment_is_shown_as_text(monkeypatch: pytest.MonkeyPatch) -> None:
    # To look at each package takes seconds.
    doctor = sys.modules["surefix.cli.doctor"]
    monkeypatch.setattr(doctor, "extra_facts", lambda: {"extras": {}})
    done = surefix_("doctor", DISPLAY=PLACE)
    assert SHOWN in done.stdout
    assert not controls(done.stdout + done.stderr)
    models = surefix_("models", TORCH_HOME=PLACE)
    assert SHOWN in models.stdout
    assert not controls(models.stdout + models.stderr)
