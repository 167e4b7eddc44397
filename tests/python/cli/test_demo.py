"""``surefix demo``: its report is whole and true, and agrees with the fixes that it wrote."""

import contextlib
import csv
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import surefix
from surefix.simulate import Route

pytest.importorskip("matplotlib")
pytest.importorskip("bokeh")

from PIL import Image

from commands import surefix_, surefix_process
from html_reader import read
from surefix.cli.demo import WHEELS, legs
from surefix.report.demo import FILES
from surefix.study.demo import ACCEPT

# The fixtures draw whole reports.
pytestmark = pytest.mark.slow

PLACES, SIZE, SEED = 120, (96, 48), 3
# A stop of 4 frames is all that the second drive has beside a frame a place.
FRAMES = PLACES + 4
PICTURES = [name for name in FILES if name.endswith(".png")]


@dataclass
class Demo:
    folder: Path
    said: subprocess.CompletedProcess[str]

    def table(self, name: str) -> list[dict[str, str]]:
        with (self.folder / name).open(newline="") as file:
            return list(csv.DictReader(file))

    def column(self, name: str, column: str) -> np.ndarray:
        return np.array([float(row[column]) for row in self.table(name)])

    @property
    def right(self) -> np.ndarray:
        off = np.abs(self.column("fixes.csv", "place") - self.column("truth.csv", "place"))
        return (off <= 1) & ~self.off_map

    @property
    def trusted(self) -> np.ndarray:
        return np.array([row["trusted"] == "true" for row in self.table("fixes.csv")])

    @property
    def sure(self) -> np.ndarray:
        return self.column("fixes.csv", "confidence") >= ACCEPT

    @property
    def off_map(self) -> np.ndarray:
        return self.column("truth.csv", "place") < 0


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Demo:
    folder = tmp_path_factory.mktemp("demo") / "not" / "yet there"
    width, height = SIZE
    size = ("--places", PLACES, "--width", width, "--height", height, "--seed", SEED)
    return Demo(folder, surefix_process("demo", "--out", folder, *size))


def test_a_pipe_gets_plain_lines_and_the_last_says_where_the_report_is(demo: Demo) -> None:
    assert demo.said.returncode == 0, demo.said.stderr
    assert demo.said.stderr == ""
    assert all(character.isprintable() or character == "\n" for character in demo.said.stdout)
    last = demo.said.stdout.splitlines()[-1]
    assert last.startswith(f"Made {demo.folder / 'report.html'}")


def test_it_writes_the_files_that_it_names_and_no_others(demo: Demo) -> None:
    assert {file.name for file in demo.folder.iterdir()} == set(FILES)


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_has_something_on_it_and_nothing_is_cut_off(demo: Demo, name: str) -> None:
    picture = np.asarray(Image.open(demo.folder / name).convert("RGB"))
    height, width, _ = picture.shape
    assert 500 < height < 3000
    assert 700 < width < 3000
    paper = picture[0, 0]
    edge = np.concatenate([picture[:2].reshape(-1, 3), picture[-2:].reshape(-1, 3)])
    sides = np.concatenate([picture[:, :2].reshape(-1, 3), picture[:, -2:].reshape(-1, 3)])
    assert (edge == paper).all()
    assert (sides == paper).all()
    assert (picture != paper).any(axis=2).mean() > 0.04


def test_the_fixes_in_the_file_are_those_of_the_live_drive(demo: Demo) -> None:
    route = Route(places=PLACES, size=SIZE, seed=SEED)
    reference, revisit = route.reference(), route.revisit(legs=legs(PLACES))
    known = surefix.Map.from_images(reference, surefix.Sad())
    localizer = surefix.Localizer(known, motion="any")
    advance = revisit.odometry(**WHEELS) / 3.0
    fixes = [
        localizer.push(image, advance=moved) for image, moved in zip(revisit, advance, strict=True)
    ]
    rows = demo.table("fixes.csv")
    assert [int(row["place"]) for row in rows] == [fix.place for fix in fixes]
    assert [float(row["score"]) for row in rows] == pytest.approx(
        [fix.score for fix in fixes], rel=1e-6
    )
    assert demo.trusted.tolist() == [fix.trusted for fix in fixes]
    assert demo.column("fixes.csv", "confidence").tolist() == pytest.approx(
        [fix.confidence for fix in fixes]
    )
    assert demo.column("truth.csv", "place").tolist() == revisit.truth(reference).tolist()
    assert demo.column("truth.csv", "advance").tolist() == pytest.approx(advance, abs=1e-6)


def test_the_drive_stops_and_leaves_the_map_and_confidence_falls_and_returns(demo: Demo) -> None:
    place, advance = demo.column("truth.csv", "place"), demo.column("truth.csv", "advance")
    first = PLACES * 35 // 100
    assert len(place) == FRAMES
    assert (np.flatnonzero(advance == 0)[1:] == np.arange(first, first + 4)).all()
    assert (np.diff(place[first - 1 : first + 4]) == 0).all()
    off = np.flatnonzero(demo.off_map)
    assert 10 < len(off) == off[-1] - off[0] + 1 < PLACES / 5
    confidence = demo.column("fixes.csv", "confidence")
    assert confidence[off].mean() < 0.6 * confidence[~demo.off_map].mean()
    assert confidence[off].min() < 0.5
    assert demo.sure[off[-1] + 1 :].any()
    assert not demo.sure[off].any()


def test_the_baseline_is_the_sequence_without_weights(demo: Demo) -> None:
    # In the other words of NumPy, at the default length 2.
    D = np.load(demo.folder / "distances.npy").astype(np.float64)
    assert D.shape == (PLACES, FRAMES)
    best = np.argmin(D[1:, 1:] + D[:-1, :-1], axis=0) + 1
    assert demo.column("baseline.csv", "place")[1:].tolist() == best.tolist()


def test_the_numbers_on_the_page_are_those_of_the_fixes(demo: Demo) -> None:
    right, trusted, sure, off = demo.right, demo.trusted, demo.sure, demo.off_map
    assert not (right & off).any()
    shown = read((demo.folder / "report.html").read_text(encoding="utf-8")).ids
    assert shown["right"] == f"{100 * right[~off].mean():.1f} %"
    assert shown["sure"] == f"{100 * sure.mean():.1f} %"
    assert shown["trusted-right"] == f"{100 * right[trusted].mean():.1f} %"
    assert shown["sure-right"] == f"{100 * right[sure].mean():.1f} %"
    assert shown["sure-off-map"] == str((sure & off).sum())
    said = demo.said.stdout
    on = FRAMES - off.sum()
    assert f"{right.sum()} of the {on} on the map right, and {off.sum()} taken off it" in said
    for name, of in (("Trusted fixes", trusted), (f"Sure fixes, of confidence {ACCEPT:g}", sure)):
        counts = f"{(of & right).sum()} of {of.sum()} right, {(of & ~right).sum()} wrong\n"
        assert any(
            line.startswith(name) and line.endswith(counts) for line in said.splitlines(True)
        )
    areas = [area_upto(demo, name) for name in ("weighted.csv", "baseline.csv")]
    line = next(line for line in said.splitlines() if line.startswith("The paper's sequence"))
    said_areas = [float(part) for part in re.findall(r"\d\.\d\d", line)]
    assert said_areas == pytest.approx(areas, abs=0.0051)


def area_upto(demo: Demo, name: str, upto: float = 0.2) -> float:
    """The area under the precision-recall curve up to a recall, by a sum over a fine grid of
    recalls.
    """
    ready = np.array([row["ready"] == "true" for row in demo.table(name)])
    true_place = demo.column("truth.csv", "place")
    right = ((np.abs(demo.column(name, "place") - true_place) <= 1) & (true_place >= 0))[ready]
    scores = demo.column(name, "score")[ready]
    points = [
        (right[scores <= s].sum() / right.sum(), right[scores <= s].mean())
        for s in np.unique(scores)
    ]
    # If recall stays, the curve goes on from the last precision.
    recall, precision = np.array(
        [(r, p) for k, (r, p) in enumerate(points) if [*points, (2, 0)][k + 1][0] > r]
    ).T
    grid = np.linspace(0, upto, 20_001)
    return float(np.interp(grid, np.r_[0, recall], np.r_[points[0][1], precision]).mean())


def test_the_page_is_whole_and_needs_nothing_else(demo: Demo) -> None:
    reader = read((demo.folder / "report.html").read_text(encoding="utf-8"))
    assert reader.language == "en"
    assert all(link.startswith("data:image/") for link in reader.links)
    assert not reader.tags & {"link", "iframe"}
    still = [image for image in reader.images if "src" in image]
    # The frame of the top and its match, the confidence, and the pairs of each outcome.
    assert len(still) == 4
    assert all(image["alt"] and int(image["width"]) and int(image["height"]) for image in still)
    assert "not" in reader.text
    assert f"--places {PLACES} " in reader.text
    assert f"--seed {SEED} " in reader.text
    for name in FILES:
        assert name in reader.text


def test_a_folder_that_cannot_be_made_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    out = tmp_path / "file" / "demo"
    said = surefix_("demo", "--out", out, code=1)
    assert said.stdout == ""
    assert said.stderr.startswith(f"surefix: {out}: cannot make the output folder: ")
    assert said.stderr.count("\n") == 1


@pytest.mark.usefixtures("undrawn")
def test_a_report_that_cannot_be_written_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "route.png").mkdir()
    small = ("--places", 20, "--width", 32, "--height", 16)
    said = surefix_("demo", "--out", tmp_path, *small, code=1)
    assert said.stderr.startswith(f"surefix: {tmp_path}: cannot write the report: ")
    assert said.stderr.count("\n") == 1


# What a plain wheel lacks.
LACKING = ("PIL", "bokeh", "matplotlib", "sklearn", "scipy", "pandas")


@pytest.mark.parametrize("town", [False, True])
def test_without_what_draws_it_localizes_and_says_what_would(tmp_path: Path, town: bool) -> None:
    for name in LACKING:
        missing = f"raise ModuleNotFoundError(name={name!r})\n"
        (tmp_path / f"{name}.py").write_text(missing)
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    size = ("--places", 60, "--width", 64, "--height", 32, *(["--town"] if town else []))
    said = surefix_process("demo", "--out", tmp_path / "out", *size, PYTHONPATH=path)
    *lines, last = said.stdout.splitlines()
    words = r"No report and no pictures: the report takes \w+, which is not installed: "
    assert re.fullmatch(words + r'pip install "surefix\[report\]"', last)
    assert any(" right" in line for line in lines)
    assert said.stderr == ""
    assert not (tmp_path / "out").exists()
    surefix_process("demo", "--help", PYTHONPATH=path)


@pytest.mark.parametrize(
    "options", [("--places", "1"), ("--width", "wide"), ("--sequence-length", "0")]
)
def test_bad_usage_is_exit_code_2(options: Sequence[str]) -> None:
    surefix_("demo", *options, code=2)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="a pseudo-terminal is needed")
def test_on_a_terminal_the_drive_is_shown_live(tmp_path: Path) -> None:
    import pty

    ours, theirs = pty.openpty()
    command = [sys.executable, "-m", "surefix", "demo", "--out", str(tmp_path)]
    size = ["--places", "20", "--width", "32", "--height", "16"]
    environment = os.environ | {"TERM": "xterm-256color", "COLUMNS": "100", "LINES": "40"}
    process = subprocess.Popen([*command, *size], stdout=theirs, stderr=theirs, env=environment)
    os.close(theirs)
    shown = bytearray()
    # An OSError is how Linux says that the other side has closed.
    with contextlib.suppress(OSError):
        while chunk := os.read(ours, 65536):
            shown += chunk
    os.close(ours)
    assert process.wait() == 0
    text = shown.decode("utf-8")
    assert "\x1b[" in text
    for word in ("frame 21 of 21", "trusted (", "distances: ", "▀"):
        assert word in text
    assert f"Made {tmp_path / 'report.html'}" in text.splitlines()[-1]
