"""``surefix align``: a truth for ``surefix eval``."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surefix
from commands import surefix_

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture
def distances(tmp_path: Path) -> Path:
    rng = np.random.default_rng(0)
    np.save(tmp_path / "D.npy", (rng.normal(0, 0.3, (50, 50)) - np.eye(50)).astype(np.float32))
    return tmp_path / "D.npy"


def same_table(path: Path, expected: Path) -> None:
    """The columns of ``Alignment.to_csv``, to the last digit, and more."""
    got, wanted = (np.genfromtxt(each, delimiter=",", names=True) for each in (path, expected))
    for name in wanted.dtype.names:
        np.testing.assert_array_equal(got[name], wanted[name], err_msg=name)


def test_its_file_is_the_truth_of_an_eval(distances: Path, tmp_path: Path) -> None:
    truth = tmp_path / "truth.csv"
    done = surefix_("align", distances, "--motion", "steady", "--least", 0.9, "-o", truth)
    alignment = surefix.align(np.load(distances), motion="steady")
    expected = tmp_path / "expected.csv"
    alignment.to_csv(expected, 0.9)
    same_table(truth, expected)
    sure = int((alignment.confidence >= 0.9).sum())
    assert 0 < sure < 50
    assert f"50 queries, {sure} with a reference of confidence 0.9 or more" in done.stderr
    pytest.importorskip("matplotlib")
    report = ("--truth", truth, "--method", "single", "-o", tmp_path / "report")
    assert "single: area" in surefix_("eval", distances, *report).stdout


def test_a_map_and_its_queries_are_aligned(tmp_path: Path) -> None:
    rows = np.random.default_rng(1).normal(size=(40, 12)).astype(np.float32)
    surefix.Map.from_descriptors(rows).save(tmp_path / "route.safetensors")
    np.save(tmp_path / "queries.npy", rows[3:30] + np.float32(0.1))
    route, queries = tmp_path / "route.safetensors", tmp_path / "queries.npy"
    surefix_("align", route, queries, "-o", tmp_path / "truth.csv")
    table = np.genfromtxt(tmp_path / "truth.csv", delimiter=",", names=True)
    assert np.abs(table["place"] - np.arange(3, 30)).max() <= 1


def road(noise: float, seed: int = 0) -> Any:
    """The descriptors of 60 places, and of a drive from the fifth to the 50th."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(60, 12)).astype(np.float32)
    return rows, (rows[5:50] + noise * rng.normal(size=(45, 12))).astype(np.float32)


def matrix(noise: float, seed: int, path: Path) -> Any:
    rows, seen = road(noise, seed)
    D = np.linalg.norm(rows[:, None] - seen[None], axis=2).astype(np.float32)
    np.save(path, D)
    return D


def test_several_techniques_are_aligned_by_all_and_ranked(tmp_path: Path) -> None:
    files = [tmp_path / f"{name}.npy" for name in ("poor", "good", "fair")]
    D = [matrix(noise, 3, file) for noise, file in zip((3.0, 0.3, 0.9), files, strict=True)]
    fuse = ["--fuse", files[1], "--fuse", files[2]]
    surefix_("align", files[0], *fuse, "--motion", "steady", "-o", tmp_path / "truth.csv")
    surefix.align(D, motion="steady").to_csv(tmp_path / "expected.csv", 0.5)
    same_table(tmp_path / "truth.csv", tmp_path / "expected.csv")

    done = surefix_("audit", files[0], *fuse, "--motion", "steady", "--accept", 0.9)
    run = surefix.match_distances(D, motion="steady")
    found = surefix.audit(D, motion="steady", run=run)
    _, ranking, thresholds, _ = done.stdout.split("\n\n")
    lines = [line.split() for line in ranking.splitlines()[2:]]
    assert [line[0] for line in lines] == ["good", "fair", "poor", "good"]
    poor, good, fair = found.techniques
    for name, each, row in (("good", good, 0), ("fair", fair, 1), ("poor", poor, 2)):
        line = ranking.splitlines()[2 + row]
        assert line.startswith(name)
        assert str(each.recall_at_1) in line
        assert each is good or str(good.difference(each)) in line
    assert "good is the best here" in ranking
    accepted = found.accepted(1 - 0.9)
    right = found.accepted_precision(1 - 0.9)
    said = f"of 0.9 or more that are right: {right} of {accepted.sum()}"
    assert said in done.stdout
    assert f"0.9         {accepted.mean():.0%}" in thresholds
    assert str(right) in thresholds


def test_techniques_that_are_alike_are_not_ranked(tmp_path: Path) -> None:
    for name in ("one", "two"):
        matrix(0.9, 3, tmp_path / f"{name}.npy")
    done = surefix_("audit", tmp_path / "one.npy", "--fuse", tmp_path / "two.npy")
    assert "one is not surely the best: the drive does not tell it from two." in done.stdout


def test_a_map_its_queries_and_their_odometry(tmp_path: Path) -> None:
    rows, seen = road(0.8)
    where = np.stack([np.arange(60) * 2.0, np.zeros(60)], axis=1)
    route = tmp_path / "route.safetensors"
    place_map = surefix.Map.from_descriptors(rows, positions=where)
    place_map.save(route)
    np.save(tmp_path / "queries.npy", seen)
    poses = tmp_path / "poses.txt"
    poses.write_text("".join(f"1 0 0 0 0 1 0 0 0 0 1 {2 * i}\n" for i in range(45)))
    arguments = (route, tmp_path / "queries.npy", "--odometry", poses)
    done = surefix_("align", *arguments, "-o", tmp_path / "truth.csv")
    assert "0.5 places a metre (the map's positions)" in done.stderr
    advance = np.array([0.0, *np.ones(44)])
    expected = surefix.align(place_map, seen, advance=advance)
    expected.to_csv(tmp_path / "expected.csv", 0.5)
    same_table(tmp_path / "truth.csv", tmp_path / "expected.csv")
    header = (tmp_path / "truth.csv").read_text().splitlines()[0]
    assert header.endswith(",single_right,segment,segment_place,x,y")
    done = surefix_("audit", *arguments, "--spacing", 2)
    found = surefix.audit(place_map, seen, advance=advance)
    assert f"right: {found.recall_at_1} of 45 queries" in done.stdout

    # The positions are those of the queries, too.
    pytest.importorskip("matplotlib")
    truth = ("--query-positions", tmp_path / "truth.csv", "--tolerance", 3, "--method", "single")
    surefix_("eval", route, tmp_path / "queries.npy", *truth, "-o", tmp_path / "report")


def test_the_report_names_each_doubtful_stretch(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    rng = np.random.default_rng(9)
    rows, seen = road(0.4)
    # Nothing known after query 15.
    seen[15:] = rng.normal(size=(30, 12))
    surefix.Map.from_descriptors(rows).save(tmp_path / "route.safetensors")
    np.save(tmp_path / "queries.npy", seen)
    given = (tmp_path / "route.safetensors", tmp_path / "queries.npy")
    out = ("-o", tmp_path / "truth.csv", "--report", tmp_path / "page")
    done = surefix_("align", *given, *out)
    assert f"a report, {tmp_path / 'page' / 'report.html'}" in done.stderr
    found = surefix.align(surefix.Map.open(given[0]), seen)
    with (tmp_path / "page" / "doubtful.csv").open(newline="") as file:
        stretches = list(csv.DictReader(file))
    doubtful = [
        query
        for each in stretches
        for query in range(int(each["first_query"]), int(each["last_query"]) + 1)
    ]
    expected = np.flatnonzero((found.confidence < 0.5) | (found.off_map >= 0.5))
    assert doubtful == expected.tolist()
    assert {*range(25, 45)} & {*doubtful}
    assert not {*range(15)} & {*doubtful}
    for each in stretches:
        queries = slice(int(each["first_query"]), int(each["last_query"]) + 1)
        assert int(each["place_low"]) == found.interval[queries, 0].min()
        assert (found.off_map[queries] >= 0.5).all() == (each["off_map"] == "true")
    text = (tmp_path / "page" / "report.html").read_text()
    assert f"somewhere from place {stretches[0]['place_low']} to" in text or "off the map" in text
    assert (tmp_path / "page" / "distance_matrix.png").exists()
    steps = np.abs(np.diff(found.place))
    for query in np.flatnonzero(steps > 12) + 1:
        assert (
            f"at query {query} from place {found.place[query - 1]} to {found.place[query]}" in text
        )

    # A drive without doubt says so; several techniques are drawn as one, and long ones thinned.
    np.save(tmp_path / "D.npy", 1 - np.eye(1300, dtype=np.float32))
    both = ("align", tmp_path / "D.npy", "--fuse", tmp_path / "D.npy", "--motion", "steady")
    surefix_(*both, *out)
    text = (tmp_path / "page" / "report.html").read_text()
    assert "No stretch is doubtful" in text
    assert "The track does not jump." in text


MISTAKES = {
    "no queries": (["route.safetensors"], 2, "expected images or descriptors, got none"),
    "queries too many": (["D.npy", "photos"], 2, "expected none with distances"),
    "an unknown motion": (["D.npy", "--motion", "fast"], 2, "'--motion'"),
    "no table": (["D.npy", "-o", "truth.pdf"], 2, "ends in .csv"),
    "similarities of a map": (["route.safetensors", "q", "--similarity"], 2, "--similarity"),
    "no file": (["none.npy"], 1, "none.npy"),
    "no folder": (["D.npy", "-o", "none/t.csv"], 1, "surefix: none/t.csv: cannot write the fixes"),
    "a map beside distances": (
        ["D.npy", "--fuse", "route.safetensors"],
        2,
        "--fuse route.safetensors: expected a .npy of",
    ),
    "other distances": (["D.npy", "--fuse", "small.npy"], 1, "expected the shape (50, 50)"),
    "another map": (
        ["route.safetensors", "q.npy", "--fuse", "longer.safetensors"],
        1,
        "--fuse longer.safetensors: expected a map of 4 places, got 5",
    ),
    "odometry of distances": (["D.npy", "--odometry", "o.csv"], 2, "--metres, --odometry:"),
    "a spacing alone": (["route.safetensors", "q.npy", "--spacing", "2"], 2, "--odometry too"),
    "no scale": (["route.safetensors", "q.npy", "--odometry", "o.csv"], 2, "--spacing or"),
    "images for descriptors": (["route.safetensors", "i.npy"], 1, "holds ready descriptors"),
    "a folder without images": (["folder", "q.npy"], 1, "folder: expected images (png"),
    "a model for distances": (["D.npy", "--model", "megaloc"], 2, "expected a map or images"),
}


@pytest.mark.parametrize("name", MISTAKES)
@pytest.mark.parametrize("command", ["align", "audit"])
def test_a_mistake_gets_one_message(
    command: str, name: str, distances: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given, code, words = MISTAKES[name]
    if command == "audit" and "-o" in given:
        pytest.skip("audit writes no file")
    rows = np.eye(5, dtype=np.float32)
    surefix.Map.from_descriptors(rows[:4, :4]).save(tmp_path / "route.safetensors")
    surefix.Map.from_descriptors(rows).save(tmp_path / "longer.safetensors")
    np.save(tmp_path / "small.npy", rows)
    np.save(tmp_path / "q.npy", rows[:, :4])
    np.save(tmp_path / "i.npy", np.zeros((2, 8, 8), np.uint8))
    (tmp_path / "folder").mkdir()
    monkeypatch.chdir(tmp_path)
    assert words in surefix_(command, *given, code=code).stderr


def test_an_audit_says_its_estimates_in_words(distances: Path) -> None:
    done = surefix_("audit", distances, "--motion", "steady")
    found = surefix.audit(np.load(distances), motion="steady")
    assert f"Single matches right: {found.recall_at_1} of 50 queries" in done.stdout
    assert f"Trusted matches right: {found.trusted_precision} of" in done.stdout
    assert "Do not rely" not in done.stdout
    rng = np.random.default_rng(0)
    np.save(distances, rng.random((50, 50)).astype(np.float32))
    doubted = surefix_("audit", distances).stdout
    for warning in ("Do not rely on it", "misjudged more with --motion any", "say"):
        assert warning in doubted
    assert "'--motion'" in surefix_("audit", distances, "--motion", "x", code=2).stderr
