"""``surefix eval``: a user's mistake gets one clear message, and the truth may come in any of its
forms.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")
pytest.importorskip("bokeh")

from surefix import cli

pytestmark = pytest.mark.usefixtures("undrawn")

TABLES = {
    "far": "0,1\n1,2\n2,70\n",
    "late": "query,reference\n70,0\n",
    "wide": "1,2,3\n",
    "named": "a,b\n",
    "two": "0,3\n1,4\n0,5\n",
    "part": "query,reference\n0,3\n2,-1\n",
    "bare": "51.76,-1.26\n51.761,-1.261\n",
    "globe": "lat,lon\n51.76,-1.26\n51.761,-1.261\n",
    "plane": "x,y\n0,0\n0,0.5\n",
    "off": "latitude,longitude\n51,0\n91,0\n",
    "odd": "lat,y\n1,2\n",
}


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


BY_POSITION = ("--tolerance", "9", "--query-positions")
MISTAKES: dict[str, tuple[list[str], int, str]] = {
    "no truth": (["D.npy"], 2, "--truth: expected it, or --query-positions; got neither"),
    "two truths": (
        ["D.npy", "--truth", "identity", "--query-positions", "query.csv"],
        2,
        "got both",
    ),
    "no queries": (["route.safetensors", "--truth", "identity"], 2, "QUERIES: expected"),
    "a method that is none": (
        ["D.npy", "--truth", "identity", "--method", "magic"],
        2,
        "masked, gradient",
    ),
    "no metres": (
        ["D.npy", "--query-positions", "query.csv"],
        2,
        "--tolerance: expected how many metres",
    ),
    "half a place": (
        ["D.npy", "--truth", "identity", "--tolerance", "0.5"],
        2,
        "whole number of places, got 0.5",
    ),
    "no calibration": (
        ["D.npy", "--truth", "identity", "--method", "supervised-masked"],
        2,
        "--calibration",
    ),
    "a weight of 2": (["D.npy", "--truth", "identity", "-w", "2"], 2, "from 0 to 1, got 2"),
    "a long sequence": (["D.npy", "--truth", "identity", "-L", "71"], 2, "from 1 to 70"),
    "a floor of words": (
        ["D.npy", "--truth", "identity", "--floor", "low"],
        2,
        '"global", "running" or a number',
    ),
    "another recall": (["D.npy", "--truth", "identity", "--recall", "all"], 2, "place_exists"),
    "no map": (
        ["nowhere.safetensors", "winter.npy", "--truth", "identity"],
        1,
        "nowhere.safetensors",
    ),
    "no matrix": (["nowhere.npy", "--truth", "identity"], 1, "nowhere.npy: cannot read the matrix"),
    "images for distances": (
        ["winter.npy", "--truth", "identity"],
        2,
        "QUERIES: expected the drive's images or descriptors, got none",
    ),
    "a folder without images": (
        [".", "winter.npy", "--truth", "identity"],
        1,
        ".: expected images (png, jpeg",
    ),
    "no truth file": (["D.npy", "--truth", "gone.csv"], 1, "gone.csv: cannot read"),
    "a truth of words": (
        ["D.npy", "--truth", "yes"],
        1,
        "expected \"identity\", a .npy or a .csv, got 'yes'",
    ),
    "a short truth": (
        ["D.npy", "--truth", "short.npy"],
        1,
        "short.npy: expected places, int (70,)",
    ),
    "a place off the map": (
        ["D.npy", "--truth", "far.npy"],
        1,
        "expected places from 0 to 69, or -1",
    ),
    "a place off the table": (
        ["D.npy", "--truth", "far.csv"],
        1,
        "far.csv, row 3, column reference: expected a whole",
    ),
    "a query off the table": (
        ["D.npy", "--truth", "late.csv"],
        1,
        "late.csv, row 2, column query: expected a whole",
    ),
    "three columns": (["D.npy", "--truth", "wide.csv"], 1, "wide.csv, row 1: expected 2 values"),
    "other columns": (
        ["D.npy", "--truth", "named.csv"],
        1,
        "named.csv, row 1: expected the columns query,reference",
    ),
    "a query twice": (
        ["D.npy", "--truth", "two.csv"],
        1,
        "two.csv, row 3: expected one reference a query, got 5 for",
    ),
    "a query without a row": (["D.npy", "--truth", "part.csv"], 1, "each of the 70 queries"),
    "similarities of a map": (
        ["route.safetensors", "winter.npy", "--truth", "identity", "--similarity"],
        2,
        "a map",
    ),
    "degrees that do not say so": (
        ["D.npy", *BY_POSITION, "bare.csv", "--positions", "bare.csv"],
        1,
        "latitude,longi",
    ),
    "degrees and metres": (
        ["D.npy", *BY_POSITION, "plane.csv", "--positions", "globe.csv"],
        1,
        "share no plane",
    ),
    "degrees off the globe": (
        ["D.npy", *BY_POSITION, "off.csv", "--positions", "globe.csv"],
        1,
        "off.csv: latitude",
    ),
    "half a header": (
        ["D.npy", *BY_POSITION, "odd.csv", "--positions", "globe.csv"],
        1,
        "odd.csv, row 1: expected the",
    ),
    "too few positions": (
        ["D.npy", *BY_POSITION, "globe.csv", "--positions", "globe.csv"],
        1,
        "expected 70 rows",
    ),
    "a hole": (
        ["hole.npy", "--truth", "identity"],
        1,
        "expected finite numbers, got nan at place 3, query 5",
    ),
    "few references": (
        ["D.npy", "--truth", "identity", "--references", "few.npy"],
        1,
        "each of 70 places, got 7",
    ),
    "few images": (["D.npy", "few.npy", "--truth", "identity"], 1, "got 7 images for 70 queries"),
    "a file in the way": (
        ["D.npy", "--truth", "identity", "-o", "D.npy/x"],
        1,
        "cannot make the output folder",
    ),
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


def test_a_table_has_a_row_a_query_in_any_order(tmp_path: Path) -> None:
    from surefix.tables.truth import read_truth

    file = tmp_path / "truth.csv"
    file.write_text("# mine\n3,-1\n0,3\n2,\n1,4\n0,3\n")
    assert read_truth(str(file), 5, 4).tolist() == [3, 4, -1, -1]


def test_degrees_of_both_drives_become_metres_about_one_origin(tmp_path: Path) -> None:
    from surefix.tables.positions import Positions, on_one_plane, planar, read_positions

    names = [tmp_path / f"{name}.csv" for name in ("references", "queries", "plane")]
    names[0].write_text("time,lat,lon\n1,51.76,179.999\n2,51.761,179.999\n")
    names[1].write_text("Latitude,Longitude\n51.761,-179.999\n")
    names[2].write_text("x,y\n0,0\n0,0.5\n")
    places, queries = on_one_plane(read_positions(names[0]), read_positions(names[1]))
    assert np.linalg.norm(places[1] - places[0]) == pytest.approx(111.26, abs=0.01)
    # Across the date line: 0.002 degrees, each 111.32 km times the cosine of the latitude, and a
    # little for the globe.
    assert queries[0] - places[1] == pytest.approx(
        [0.002 * 111_320 * np.cos(np.radians(51.761)), 0], rel=3e-3
    )
    # For a map: metres stay, degrees know their origin.
    assert planar(read_positions(names[2])).values.tolist() == [[0, 0], [0, 0.5]]
    made = planar(read_positions(names[0]))
    assert made.origin == pytest.approx((51.7605, 179.999))
    assert np.array_equal(made.values, places)
    # Beside a map's positions, degrees are brought onto its plane.
    assert made.origin is not None
    where = Positions("the map", made.values, said=True, origin=made.origin)
    again = on_one_plane(where, read_positions(names[1]))
    assert np.array_equal(again[1], queries)


@pytest.mark.slow
@pytest.mark.parametrize("module", ["matplotlib", "PIL"])
def test_without_what_draws_one_line_says_how_to_install_it(
    module: str, drives: Path, tmp_path: Path
) -> None:
    (tmp_path / f"{module}.py").write_text(f"raise ModuleNotFoundError(name={module!r})\n")
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
        assert 'pip install "surefix[report]"' in said.stderr or code == 0
