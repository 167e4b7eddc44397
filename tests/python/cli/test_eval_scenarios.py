"""``surefix eval --scenario``: its table is that of the study, in the terminal, as CSV and on the
page.
"""

import csv
import re
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")
pytest.importorskip("bokeh")

from commands import surefix_
from html_reader import read
from surefix.baselines import Context
from surefix.report import figures
from surefix.report.page import Picture, drawn
from surefix.study import SCENARIOS, Study

METHODS = ("sequence", "topological", "track_odometry")
HOW = {"scale_error": 0.03, "noise": 0.1}


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scenarios")
    rng = np.random.default_rng(0)
    D = rng.normal(0, 0.4, (60, 60)) - np.eye(60)
    np.save(folder / "D.npy", D.astype(np.float32))
    (folder / "train.csv").write_text("speed, m/s, of a train\n" + "0\n" * 9 + "20.5\n" * 60)
    (folder / "two.csv").write_text("time,speed\n0,1\n")
    (folder / "back.csv").write_text("1\n-2\n")
    (folder / "empty.csv").write_text("speed\n")
    return folder


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """One small picture in place of all but the diagrams."""

    def small(*_: object, **__: object) -> Picture:
        return drawn((2, 2), "small", lambda ax, theme: ax)

    for name in ("curves", "numbers", "matrix", "mistakes"):
        monkeypatch.setattr(figures, name, lambda *_, **__: {})
    for name in ("trust", "strip"):
        monkeypatch.setattr(figures, name, small)


@pytest.mark.usefixtures("undrawn")
def test_the_tables_are_those_of_the_study(drives: Path, tmp_path: Path) -> None:
    options = [f"--method={name}" for name in METHODS]
    options += ["--scenario", "all", "--scenario", "recorded", "--scenario", "all", "--seed", 3]
    done = surefix_("eval", drives / "D.npy", "--truth", "identity", *options, "-o", tmp_path)
    D = np.load(drives / "D.npy")
    context = Context(truth=np.arange(60), truth_tolerance=1)
    # By the recorded drive's own odometry, too.
    recorded = Study(D, context, names=METHODS).driven("recorded", 3, **HOW)
    with (tmp_path / "scenarios.csv").open(newline="") as file:
        found = {(row["scenario"], row["method"]): row for row in csv.DictReader(file)}
    studies = {"recorded": recorded, "all": recorded.driven("all", 3, **HOW)}
    assert list(found) == [(scenario, name) for scenario in studies for name in METHODS]
    page = read((tmp_path / "report.html").read_text())
    for scenario, study in studies.items():
        lines = done.stdout.partition(f"\n{scenario}: ")[2].splitlines()
        assert SCENARIOS[scenario].description in lines[0]
        assert SCENARIOS[scenario].description in page.text
        printed = [line for line in lines if line.startswith(METHODS)]
        assert max(map(len, printed)) < 100
        for line, name in zip(printed, METHODS, strict=False):
            row, result = found[scenario, name], study[name]
            assert float(row["area"]) == pytest.approx(result.curve.auc(1.0))
            assert float(row["right"]) == pytest.approx(result.right_share)
            assert int(row["lost"] or 0) == len(result.relocalised)
            assert (row["calibration_error"] == "") == (name == "sequence")
            assert line.split()[:2] == [name, f"{result.curve.auc(1.0):.3f}"]
    areas = [[study[name].curve.auc(1.0) for study in studies.values()] for name in METHODS]
    assert [line.split() for line in printed[-len(METHODS) :]] == [
        [name, *(f"{area:.3f}" for area in (*row, np.mean(row)))]
        for name, row in zip(METHODS, areas, strict=True)
    ]
    best = int(np.argmax(np.mean(areas, axis=1)))
    words = rf"Over all 2 drives, {METHODS[best]} has .*, {np.mean(areas[best]):.3f} on average"
    assert re.search(words, page.text)
    assert found["all", "track_odometry"]["noticed"] != ""
    with (tmp_path / "reliability.csv").open(newline="") as file:
        bins = [row for row in csv.DictReader(file) if row["scenario"] == "all"]
    assert sum(int(row["queries"]) for row in bins) == 2 * len(studies["all"])
    assert {path.name for path in tmp_path.glob("reliability*.png")} == {
        "reliability.png",
        "reliability_all.png",
    }


@pytest.mark.usefixtures("undrawn")
def test_every_scenario_runs_with_its_usual_methods(drives: Path, tmp_path: Path) -> None:
    options = ["--scenario", "every", "--speed-profile", drives / "train.csv", "--spacing", 30]
    done = surefix_("eval", drives / "D.npy", "--truth", "identity", *options, "-o", tmp_path)
    said = re.findall(r"^([\w/-]+): .* of them off the map$", done.stdout, re.MULTILINE)
    assert said == list(SCENARIOS)
    # The last table is that of all drives.
    assert done.stdout.count("\ntrack_free ") == len(SCENARIOS) + 1
    # Without scenarios and confidences an older report's tables would look new.
    plain = ["--truth", "identity", "--method", "single", "-o", tmp_path]
    surefix_("eval", drives / "D.npy", *plain)
    assert not [path.name for path in tmp_path.glob("*") if "reliab" in path.name]
    assert not (tmp_path / "scenarios.csv").exists()


IDENTITY = ("--truth", "identity")
MISTAKES: dict[str, tuple[list[str], int, str]] = {
    "an unknown scenario": (["--scenario", "slow"], 2, "expected every or one of recorded"),
    "no speeds": (["--scenario", "profile"], 2, "expected --speed-profile"),
    "speeds for nothing": (["--speed-profile", "train.csv"], 2, "expected --scenario"),
    "odometry of nothing": (
        ["--method", "track_odometry"],
        2,
        "expected --odometry, or --scenario",
    ),
    "two columns": (
        ["--scenario", "profile", "--speed-profile", "two.csv"],
        1,
        "two.csv, row 2: expected one speed in m/s, got 2 cells",
    ),
    "backwards": (
        ["--scenario", "profile", "--speed-profile", "back.csv"],
        1,
        "speeds of 0 or more, got -2 in row 1",
    ),
    "no rows": (
        ["--scenario", "profile", "--speed-profile", "empty.csv"],
        1,
        "empty.csv: expected speeds, got none",
    ),
    "a negative error": (["--scenario", "all", "--odometry-noise", "-1"], 2, "than or equal to 0"),
    "a negative seed": (["--scenario", "all", "--seed", "-1"], 2, "than or equal to 0"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_gets_one_clear_message(
    name: str, drives: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    arguments, code, words = MISTAKES[name]
    monkeypatch.chdir(drives)
    done = surefix_("eval", "D.npy", *IDENTITY, "-o", tmp_path, *arguments, code=code)
    assert words in re.sub(r"[\s│]+", " ", done.stderr), done.stderr
    assert "Traceback" not in done.stderr


def test_several_techniques_are_one_method(drives: Path, undrawn: None, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    D = np.load(drives / "D.npy")
    other = (rng.normal(0, 0.4, (60, 60)) - np.eye(60)).astype(np.float32)
    np.save(tmp_path / "other.npy", other)
    options = ("--truth", "identity", "--fuse", tmp_path / "other.npy", "--scenario", "rate-2")
    surefix_("eval", drives / "D.npy", *options, "-o", tmp_path / "report")
    context = Context(truth=np.arange(60), techniques=[other])
    expected = Study(D, context, names=("sequence", "fused")).driven("rate-2", 0, **HOW)["fused"]
    with (tmp_path / "report" / "scenarios.csv").open() as file:
        row = next(
            row
            for row in csv.DictReader(file)
            if (row["scenario"], row["method"]) == ("rate-2", "fused")
        )
    assert float(row["right"]) == pytest.approx(expected.right_share, abs=1e-6)


@pytest.mark.parametrize(
    ("fused", "words"),
    [("small.npy", r"--fuse .*small.npy: expected the shape \(60, 60\)"), ("none.npy", "none.npy")],
)
def test_techniques_that_do_not_fit_are_refused(
    drives: Path, tmp_path: Path, fused: str, words: str
) -> None:
    np.save(tmp_path / "small.npy", np.zeros((60, 5), np.float32))
    options = ("--truth", "identity", "--fuse", tmp_path / fused, "-o", tmp_path / "report")
    done = surefix_("eval", drives / "D.npy", *options, code=1)
    assert re.search(words, done.stderr)
    options = ("--truth", "identity", "--method", "fused")
    alone = surefix_("eval", drives / "D.npy", *options, code=2)
    assert "expected --fuse" in alone.stderr
