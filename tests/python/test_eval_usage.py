"""``surefix eval``: a user's mistake gets one clear message, and the truth may come in any of its forms."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from surefix import cli

TABLES = {"far": "0,1\n1,2\n2,70\n", "late": "query,reference\n70,0\n", "wide": "1,2,3\n", "named": "a,b\n"}


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drives")
    D = np.random.default_rng(6).random((70, 70)).astype(np.float32)
    np.save(folder / "D.npy", D)
    D[3, 5] = np.nan
    np.save(folder / "hole.npy", D)
    np.save(folder / "short.npy", np.arange(5))
    np.save(folder / "far.npy", np.arange(70) + 1)
    np.save(folder / "few.npy", np.zeros((7, 4, 4), np.uint8))
    np.save(folder / "winter.npy", np.zeros((70, 4, 4), np.uint8))
    for file, text in TABLES.items():
        (folder / f"{file}.csv").write_text(text)
    return folder


def run(monkeypatch: pytest.MonkeyPatch, where: Path, *arguments: str) -> int:
    """The command line in this process; its exit code."""
    monkeypatch.chdir(where)
    monkeypatch.setattr(sys, "argv", ["surefix", "eval", *arguments])
    with pytest.raises(SystemExit) as end:
        cli.main()
    return int(end.value.code or 0)


MISTAKES: dict[str, tuple[list[str], int, str]] = {
    "no truth": (["D.npy"], 2, "--truth: expected it, or --query-positions; got neither"),
    "two truths": (["D.npy", "--truth", "identity", "--query-positions", "query.csv"], 2, "got both"),
    "no queries": (["route.safetensors", "--truth", "identity"], 2, "QUERIES: expected"),
    "a method that is none": (["D.npy", "--truth", "identity", "--method", "magic"], 2, "masked, gradient"),
    "no metres": (["D.npy", "--query-positions", "query.csv"], 2, "--tolerance: expected how many metres"),
    "half a place": (["D.npy", "--truth", "identity", "--tolerance", "0.5"], 2, "whole number of places, got 0.5"),
    "no calibration": (["D.npy", "--truth", "identity", "--method", "supervised-masked"], 2, "--calibration"),
    "a weight of 2": (["D.npy", "--truth", "identity", "-w", "2"], 2, "from 0 to 1, got 2"),
    "a long sequence": (["D.npy", "--truth", "identity", "-L", "71"], 2, "from 1 to 70"),
    "a floor of words": (["D.npy", "--truth", "identity", "--floor", "low"], 2, '"global", "running" or a number'),
    "another recall": (["D.npy", "--truth", "identity", "--recall", "all"], 2, "place_exists"),
    "no map": (["nowhere.safetensors", "winter.npy", "--truth", "identity"], 1, "nowhere.safetensors"),
    "no matrix": (["nowhere.npy", "--truth", "identity"], 1, "nowhere.npy: cannot read the matrix"),
    "images for distances": (["winter.npy", "--truth", "identity"], 1, "winter.npy: expected a matrix of floats"),
    "a folder for a map": ([".", "winter.npy", "--truth", "identity"], 1, "surefix map build"),
    "no truth file": (["D.npy", "--truth", "gone.csv"], 1, "gone.csv: cannot read"),
    "a truth of words": (["D.npy", "--truth", "yes"], 1, "expected \"identity\", a .npy or a .csv, got 'yes'"),
    "a short truth": (["D.npy", "--truth", "short.npy"], 1, "short.npy: expected places, int (70,)"),
    "a place off the map": (["D.npy", "--truth", "far.npy"], 1, "expected places from 0 to 69, or -1"),
    "a place off the table": (["D.npy", "--truth", "far.csv"], 1, "far.csv, row 3, column reference: expected a whole"),
    "a query off the table": (["D.npy", "--truth", "late.csv"], 1, "late.csv, row 2, column query: expected a whole"),
    "three columns": (["D.npy", "--truth", "wide.csv"], 1, "wide.csv, row 1: expected 2 values"),
    "other columns": (["D.npy", "--truth", "named.csv"], 1, "named.csv, row 1: expected the columns query,reference"),
    "a hole": (
        ["hole.npy", "--truth", "identity"],
        1,
        "expected finite numbers, got nan at place 3, query 5",
    ),
    "few references": (["D.npy", "--truth", "identity", "--references", "few.npy"], 1, "each of 70 places, got 7"),
    "few images": (["D.npy", "few.npy", "--truth", "identity"], 1, "got 7 images for 70 queries"),
    "a file in the way": (["D.npy", "--truth", "identity", "-o", "D.npy/x"], 1, "cannot make the output folder"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_gets_one_clear_message(
    name: str, drives: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments, code, words = MISTAKES[name]
    assert run(monkeypatch, drives, *arguments) == code
    said = capsys.readouterr()
    assert words in re.sub(r"[\s│]+", " ", said.err), said.err
    assert "Traceback" not in said.err
    assert said.out == ""


def test_a_table_may_leave_queries_out_and_give_a_query_several_places(tmp_path: Path) -> None:
    from surefix.cli.truth import read_truth

    file = tmp_path / "truth.csv"
    file.write_text("# mine\n0,3\n2,\n3,-1\n")
    assert read_truth(str(file), 5, 5).tolist() == [3, -1, -1, -1, -1]
    file.write_text("query,reference\n0,3\n0,4\n1,1\n")
    assert np.argwhere(read_truth(str(file), 5, 2)).tolist() == [[1, 1], [3, 0], [4, 0]]


def test_without_matplotlib_one_line_says_how_to_install_it(drives: Path, tmp_path: Path) -> None:
    missing = 'raise ModuleNotFoundError("No module named \'matplotlib\'", name="matplotlib")\n'
    (tmp_path / "matplotlib.py").write_text(missing)
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "surefix", "eval"]
    for arguments, code in ((["D.npy", "--truth", "identity"], 1), (["--help"], 0)):
        said = subprocess.run(
            [*command, *arguments],
            cwd=drives,
            capture_output=True,
            text=True,
            env=os.environ | {"PYTHONPATH": path},
            check=False,
        )
        assert said.returncode == code, said.stderr
        assert "Traceback" not in said.stderr
        assert "pip install 'surefix[plot]'" in said.stderr or code == 0
