"""Truths and positions of ``surefix eval``, ``tune`` and ``map build``, from their files to the
figures.
"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import surefix
from commands import surefix_
from recordings import Bag
from surefix.simulate import Route

pytest.importorskip("matplotlib")
pandas = pytest.importorskip("pandas")

N = 60
START = 1_700_000_000


@pytest.fixture(scope="module")
def road(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two drives as images named by their times at 5 Hz, a map of one, and distances."""
    folder = tmp_path_factory.mktemp("road")
    route = Route(places=N, size=(64, 32), seed=3)
    for name, drive in (("monday", route.reference()), ("tuesday", route.revisit())):
        (folder / name).mkdir()
        for number in range(N):
            stamp = START * 10**9 + number * 200_000_000
            Image.fromarray(drive[number]).save(folder / name / f"{stamp}.png")
    surefix_("map", "build", folder / "monday", "-o", folder / "map.safetensors")
    known = surefix.Map.open(folder / "map.safetensors")
    seen = [surefix.Sad().describe(each) for each in route.revisit()]
    np.save(folder / "D.npy", np.stack([known.distances(each) for each in seen], axis=1))
    way = np.arange(N) * 2.0
    pandas.DataFrame({"x": way, "y": 0 * way}).to_csv(folder / "places.csv", index=False)
    # GPS at 1 Hz, of both drives.
    seconds = np.arange(13)
    gps = {"time": START + seconds, "lat": 51.76 + seconds * 9e-5, "lon": -1.26 + 0 * seconds}
    pandas.DataFrame(gps).to_csv(folder / "gps.csv", index=False)
    metres = {"time": START + seconds, "x": seconds * 10.0, "y": 0.0 * seconds}
    pandas.DataFrame(metres).to_csv(folder / "odometry.csv", index=False)
    return folder


def evaluated(road: Path, out: Path, *arguments: Any) -> tuple[str, str, list[dict[str, str]]]:
    """Output, errors, and the fixes of the single matches."""
    done = surefix_("eval", *arguments, "-o", out, "--method", "single")
    with (out / "fixes.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["method"] == "single"]
    return done.stdout, done.stderr, rows


def test_a_truth_by_time_is_that_of_each_frame(road: Path, tmp_path: Path) -> None:
    surefix_(
        "map", "build", road / "monday", "--positions", road / "odometry.csv",
        "-o", tmp_path / "m.safetensors",
    )  # fmt: skip
    where = surefix.Map.open(tmp_path / "m.safetensors").positions
    assert where is not None
    np.testing.assert_allclose(where[:, 0], np.arange(N) * 2.0, atol=1e-3)
    queries = (road / "tuesday", "--query-positions", road / "odometry.csv", "--tolerance", 3)
    _, said, rows = evaluated(road, tmp_path / "a", tmp_path / "m.safetensors", *queries)
    assert said == ""
    assert [int(row["true_place"]) for row in rows] == list(range(N))
    assert {row["judged"] for row in rows} == {"true"}
    # Degrees against metres are refused, not compared.
    queries = (road / "tuesday", "--query-positions", road / "gps.csv", "--tolerance", 3)
    done = surefix_("eval", tmp_path / "m.safetensors", *queries, "-o", tmp_path / "b", code=1)
    assert "share no plane" in done.stderr


def test_queries_that_are_not_known_are_left_out_of_every_figure(
    road: Path, tmp_path: Path
) -> None:
    table = pandas.read_csv(road / "places.csv")
    table.loc[10:19, "x"] = np.nan
    table.to_csv(tmp_path / "q.csv", index=False)
    positions = ("--positions", road / "places.csv", "--query-positions", tmp_path / "q.csv")
    out, said, rows = evaluated(road, tmp_path / "a", road / "D.npy", *positions, "--tolerance", 3)
    assert "q.csv: 10 queries of 60 without a known place, left out of all figures" in said
    assert [row["judged"] for row in rows] == [
        "false" if 10 <= q < 20 else "true" for q in range(N)
    ]
    right = sum(row["right"] == "true" for row in rows)
    assert "single: area up to recall 0.2 is" in out
    assert f"{right} of 50 right" in out
    assert sum(int(word) for word in out.split("Trusted single matches: ")[1].split()[2:3]) <= 50
    # The same by places.
    truth = pandas.DataFrame({"query": range(N), "reference": np.arange(N, dtype=float)})
    truth.loc[10:19, "reference"] = np.nan
    truth.to_csv(tmp_path / "truth.csv", na_rep="nan")
    given = ("--truth", tmp_path / "truth.csv", "--tolerance", 1)
    _, said, again = evaluated(road, tmp_path / "b", road / "D.npy", *given)
    assert "10 queries of 60" in said
    assert [row["right"] for row in again] == [row["right"] for row in rows]


def test_tune_leaves_them_out_too(road: Path, tmp_path: Path) -> None:
    table = pandas.read_csv(road / "places.csv")
    table.loc[10:19, "x"] = np.nan
    table.to_csv(tmp_path / "q.csv", index=False)
    positions = ("--positions", road / "places.csv", "--query-positions", tmp_path / "q.csv")
    how = ("--tolerance", 3, "--wrong", 0.3, "--motion", "steady", "-o", tmp_path / "route.toml")
    done = surefix_("tune", road / "D.npy", *positions, *how)
    assert "10 queries of 60 without a known place" in done.stderr
    judged = surefix.Settings.open(tmp_path / "route.toml").measured["judged"]
    # Of the first half, those of the warm-up aside.
    assert 10 <= int(judged.split()[0]) <= 20


def test_a_truth_that_does_not_fit_says_what_would(road: Path, tmp_path: Path) -> None:
    D = np.load(road / "D.npy")
    np.save(tmp_path / "half.npy", D[:, ::2])
    _, said, _ = evaluated(road, tmp_path / "a", tmp_path / "half.npy", "--truth", "identity")
    assert "place = 2 * query fits" in said
    assert "is every 2nd place a query?" in said
    _, said, _ = evaluated(road, tmp_path / "b", road / "D.npy", "--truth", "identity")
    assert said == ""
    np.save(tmp_path / "back.npy", D[:, ::-1].copy())
    _, said, _ = evaluated(road, tmp_path / "c", tmp_path / "back.npy", "--truth", "identity")
    assert "place = -query + 59 fits" in said


def test_nothing_comes_out_as_all_right_or_all_wrong(road: Path, tmp_path: Path) -> None:
    bare = np.stack([58 + np.arange(N) * 0.058, 10 + np.arange(N) * 1e-3], axis=1)
    cases = {
        "are these degrees": (bare, bare + 0.5),
        "tells places apart": (np.arange(2.0 * N).reshape(N, 2) / 1000,) * 2,
        "expected a query within 4 m of a place": (
            np.arange(2.0 * N).reshape(N, 2) * 5,
            bare * 1e4,
        ),
    }
    for words, (there, here) in cases.items():
        np.savetxt(tmp_path / "p.csv", there, delimiter=",", header="x,y", comments="#")
        np.savetxt(tmp_path / "q.csv", here, delimiter=",", header="x,y", comments="#")
        if "degrees" in words:
            np.savetxt(tmp_path / "p.csv", there, delimiter=",")
        positions = ("--positions", tmp_path / "p.csv", "--query-positions", tmp_path / "q.csv")
        given = (*positions, "--tolerance", 4, "-o", tmp_path / "out")
        done = surefix_("eval", road / "D.npy", *given, code=1)
        assert words in done.stderr


def test_patch_netvlads_archive_needs_no_tolerance(road: Path, tmp_path: Path) -> None:
    way = np.stack([np.arange(N) * 2.0, np.zeros(N)], axis=1)
    np.savez(tmp_path / "gt.npz", utmDb=way, utmQ=way, posDistThr=3)
    _, said, rows = evaluated(road, tmp_path / "a", road / "D.npy", "--truth", tmp_path / "gt.npz")
    assert said == ""
    near = [abs(int(row["place"]) - query) <= 1 for query, row in enumerate(rows)]
    assert [row["right"] == "true" for row in rows] == near


def test_a_bag_holds_its_own_positions(road: Path, tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    drive = Route(places=N, size=(64, 32), seed=3).revisit()
    with Bag(tmp_path, "mcap") as bag:
        for number in range(N):
            bag.image("/image", drive[number], 100 + number * 0.2)
        for second in range(14):
            fix = (51.76 + second * 9e-5, -1.26, 0.0, -1 if second == 5 else 0)
            bag.pose("/fix", "sensor_msgs/msg/NavSatFix", fix, 100.0 + second)
            pose = (second * 10.0, 0.0, 0.0)
            bag.pose("/pose", "geometry_msgs/msg/PoseStamped", pose, 100.0 + second)
    degrees = {"lat": 51.76 + np.arange(N) * 9e-5 / 5, "lon": np.full(N, -1.26)}
    pandas.DataFrame(degrees).to_csv(tmp_path / "degrees.csv", index=False)
    for topic, places in (("/fix", tmp_path / "degrees.csv"), ("/pose", road / "places.csv")):
        given = ("--positions", places, "--query-positions", topic, "--tolerance", 1.5)
        more = () if topic == "/pose" else ("--position-gap", 1.5)
        _, said, rows = evaluated(
            road, tmp_path / topic[1:], road / "map.safetensors", bag.path, *given, *more
        )
        true = [int(row["true_place"]) for row in rows]
        if topic == "/pose":
            assert (said, true) == ("", list(range(N)))
        else:
            # Without a fix for 2 s, those between are not known.
            assert [q for q in range(N) if true[q] < 0] == list(range(21, 30))
            assert "9 queries of 60 without a known place" in said
