"""``surefix tune``: a file of settings for ``surefix run --config``."""

import csv
from pathlib import Path

import numpy as np
import pytest

import surefix
from commands import surefix_

PLACES, QUERIES = 400, 200


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two maps, their queries at two places each, distances and truths."""
    folder = tmp_path_factory.mktemp("drive")
    rng = np.random.default_rng(0)
    truth = 2 * np.arange(QUERIES)
    where = np.stack([np.arange(PLACES) * 3.0, np.zeros(PLACES)], axis=1)
    rows = rng.normal(size=(PLACES, 16)).astype(np.float32)
    seen = (rows[truth] + rng.normal(size=(QUERIES, 16))).astype(np.float32)
    route = surefix.Map.from_descriptors(rows, positions=where)
    route.save(folder / "route.safetensors")
    other = rng.normal(size=rows.shape).astype(np.float32)
    surefix.Map.from_descriptors(other).save(folder / "other.safetensors")
    np.save(folder / "queries.npy", seen)
    np.save(folder / "truth.npy", truth)
    np.save(folder / "where.npy", where[truth] + 1)
    np.save(folder / "D.npy", np.stack([route.distances(row) for row in seen], axis=1))
    np.save(folder / "U.npy", rng.random((PLACES, QUERIES)).astype(np.float32))
    # Poses of KITTI: the last number is the way ahead.
    poses = "".join(f"1 0 0 0 0 1 0 0 0 0 1 {6 * query}\n" for query in range(QUERIES))
    (folder / "poses.txt").write_text(poses)
    return folder


def settings_of(*arguments: object) -> surefix.Settings:
    """Those in the file that the last argument names."""
    surefix_("tune", *arguments)
    return surefix.Settings.open(str(arguments[-1]))


def test_its_file_is_what_run_uses(drive: Path, tmp_path: Path) -> None:
    route, queries, out = drive / "route.safetensors", drive / "queries.npy", tmp_path / "r.toml"
    how = ("--truth", drive / "truth.npy", "--wrong", 0.2, "-o", out)
    done = surefix_("tune", route, queries, *how)
    known = surefix.Map.open(route)
    seen, truth = np.load(queries), np.load(drive / "truth.npy")
    tuned = surefix.tune(known, seen, truth, wrong=0.2)
    settings = surefix.Settings.open(out)
    assert (settings.options, settings.threshold) == (
        tuned.settings.options,
        tuned.settings.threshold,
    )
    assert settings.measured["route"] == f"{route}, {PLACES} places"
    assert settings.measured["queries"] == f"{queries}, {QUERIES}"
    # All trials are in the table, the choice, the promise and the file under it.
    lines = done.stdout.splitlines()
    assert lines[0].split() == ["setting", "area", "more", "than", "the", "first"]
    for trial, line in zip(tuned.trials, lines[1:], strict=False):
        assert line.startswith(trial.name)
        assert str(trial.area) in line
        assert line.endswith("chosen") == trial.chosen
    threshold = tuned.settings.threshold
    assert threshold is not None
    assert f"Threshold, by the whole drive: {threshold.promise}" in lines
    assert lines[-1] == f"Wrote {out}, for surefix run --config {out}"

    fixes = tmp_path / "fixes.csv"
    ran = surefix_("run", route, queries, "--config", out, "-o", fixes)
    assert threshold.promise in ran.stderr
    with fixes.open() as file:
        rows = list(csv.DictReader(file))
    run = surefix.match(known, seen, config=settings)
    assert [int(row["place"]) for row in rows] == run.place.tolist()
    accepted = threshold.accepts(run)
    assert accepted.any()
    assert [row["accepted"] == "true" for row in rows] == accepted.tolist()
    # Settings are for the map that they were measured on.
    other = surefix_("run", drive / "other.safetensors", queries, "--config", out, code=2)
    assert "the map that they were measured on" in other.stderr


def test_an_alignment_stands_in_for_the_truth(drive: Path, tmp_path: Path) -> None:
    out = tmp_path / "r.toml"
    done = surefix_("tune", drive / "D.npy", "--wrong", 0.2, "-o", out)
    assert (
        "The motion is as given, any: an alignment cannot choose it, a --truth can" in done.stdout
    )
    settings = surefix.Settings.open(out)
    tuned = surefix.tune(np.load(drive / "D.npy"), wrong=0.2)
    assert settings.threshold == tuned.settings.threshold
    assert settings.measured["truth"] == "an alignment, motion any"
    fused = settings_of(drive / "D.npy", "--fuse", drive / "U.npy", "--motion", "free", "-o", out)
    assert fused.options["motion"]["speeds"] == [0, 0.5, 1, 1.5, 2]
    tuned = surefix.tune([np.load(drive / name) for name in ("D.npy", "U.npy")], motion="free")
    assert fused.options == tuned.settings.options


def test_positions_and_odometry_are_read(drive: Path, tmp_path: Path) -> None:
    out = tmp_path / "r.toml"
    route, queries = drive / "route.safetensors", drive / "queries.npy"
    positions = ("--query-positions", drive / "where.npy", "--tolerance", 4)
    settings = settings_of(route, queries, *positions, "--odometry", drive / "poses.txt", "-o", out)
    known = surefix.Map.open(route)
    assert known.positions is not None
    advance = np.array([0.0, *[2.0] * (QUERIES - 1)])
    truth = (known.positions, np.load(drive / "where.npy"))
    tuned = surefix.tune(known, np.load(queries), truth, tolerance=4, advance=advance)
    assert settings.threshold == tuned.settings.threshold
    assert settings.measured["truth"] == "positions"
    # Odometry tells the pace.
    assert not any("pace" in trial.name for trial in tuned.trials)


def test_the_weights_are_named_by_their_files(drive: Path, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    rows = rng.normal(size=(600, 24))
    seen = rows + 3 * rng.normal(size=rows.shape)
    near = np.linalg.norm(rows[:, None] - seen[None], axis=2).astype(np.float32)
    # Each stretch is a drive of its own: the places between are far from every query.
    apart = np.full((600 + 20 * 15, 600), near.max(), np.float32)
    known = np.arange(600) + 20 * (np.arange(600) // 40)
    apart[known] = near
    useless = rng.random(apart.shape).astype(np.float32)
    for name, array in (("good", apart), ("useless", useless), ("truth", known)):
        np.save(tmp_path / f"{name}.npy", array)
    how = ("--truth", tmp_path / "truth.npy", "-o", tmp_path / "r.toml")
    done = surefix_("tune", tmp_path / "good.npy", "--fuse", tmp_path / "useless.npy", *how)
    assert "Weights: good 1, useless 0" in done.stdout
    assert "surely better than any" in done.stdout
    assert "Threshold, by the second half" in done.stdout


def test_a_truth_that_may_be_wrong_is_said(drive: Path, tmp_path: Path) -> None:
    truth = np.load(drive / "truth.npy")
    truth[100:120] += 40
    np.save(tmp_path / "truth.npy", truth)
    given = (drive / "route.safetensors", drive / "queries.npy", "--truth", tmp_path / "truth.npy")
    said = surefix_("tune", *given, "-o", tmp_path / "r.toml").stderr
    assert "contradicts the truth, queries 100 to 119: places 240 to 278 by the truth" in said
    assert "it may be the truth that is wrong" in said


MISTAKES = {
    "no table": (["D.npy", "-o", "r.txt"], 2, "ends in .toml"),
    "no folder": (["D.npy", "-o", "none/r.toml"], 1, "there is no folder"),
    "no queries": (["route.safetensors"], 2, "expected images or descriptors, got none"),
    "two truths": (
        ["D.npy", "--truth", "identity", "--query-positions", "where.npy"],
        2,
        "--truth: expected no positions too",
    ),
    "positions of places alone": (["D.npy", "--positions", "where.npy"], 2, "--query-positions"),
    "no metres": (["D.npy", "--query-positions", "where.npy"], 2, "--tolerance: expected how many"),
    "half a place": (["D.npy", "--tolerance", 0.5], 2, "a whole number of places"),
    "an unknown motion": (["D.npy", "--motion", "fast"], 2, "'--motion'"),
    "no share": (["D.npy", "--wrong", 0], 2, "--wrong: expected"),
    "another truth": (["D.npy", "--truth", "short.npy"], 1, "short.npy"),
    "no positions of places": (
        ["D.npy", "--query-positions", "where.npy", "--tolerance", 3],
        2,
        "--positions: expected those of the places",
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_gets_one_message(
    name: str, drive: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given, code, words = MISTAKES[name]
    np.save(drive / "short.npy", np.arange(QUERIES - 1))
    monkeypatch.chdir(drive)
    assert words in surefix_("tune", *given, code=code).stderr


def test_what_is_read_is_not_written(drive: Path, tmp_path: Path) -> None:
    link = tmp_path / "r.toml"
    link.symlink_to(drive / "D.npy")
    done = surefix_("tune", drive / "D.npy", "-o", link, code=2)
    # The message is in a box.
    assert "is what is read" in " ".join(done.stderr.replace("│", "").split())
