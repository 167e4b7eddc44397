"""`surefix run` with a track: how sure each fix is, which are accepted, and what the summary says."""

import csv
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surefix
from commands import surefix_
from surefix.cli.tracked import Agreement
from surefix.simulate import Route

PLACES = 300
Floats = np.ndarray[Any, np.dtype[np.float32]]


def seen(rows: Floats, order: Any, noise: float = 0.6) -> Floats:
    """The descriptors of places, seen again with noise."""
    again = np.random.default_rng(2).normal(size=(len(order), rows.shape[1]))
    result: Floats = (rows[order] + noise * again).astype(np.float32)
    return result


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map, a drive that leaves it for 30 frames, and one at three times the map's rate."""
    folder = tmp_path_factory.mktemp("drive")
    generator = np.random.default_rng(1)
    rows = generator.normal(size=(PLACES, 64)).astype(np.float32)
    surefix.Map.from_descriptors(rows).save(folder / "route.safetensors")
    away = generator.normal(size=(30, 64)).astype(np.float32)
    leaves = (seen(rows, np.arange(60)), away, seen(rows, np.arange(90, 150)))
    np.save(folder / "leaves.npy", np.concatenate(leaves))
    np.save(folder / "even.npy", seen(rows, np.arange(150), 0.2))
    np.save(folder / "thrice.npy", seen(rows, np.arange(0, PLACES, 3), 0.2))
    with (folder / "poses.txt").open("w") as file:
        file.writelines(f"1 0 0 0 0 1 0 0 0 0 1 {i}\n" for i in range(150))
    return folder


@pytest.mark.parametrize("motion", ["any", "free", None])
def test_rows_and_summary_have_the_track(motion: Any, drive: Path) -> None:
    route = surefix.Map.open(drive / "route.safetensors")
    localizer = surefix.Localizer(route, motion=motion or "any", tolerance=2)
    fixes = [localizer.push(row) for row in np.load(drive / "leaves.npy")]
    tracks = [fix.track for fix in fixes if fix.track is not None]
    chosen = [] if motion is None else ["--motion", motion]
    arguments = ["run", drive / "route.safetensors", drive / "leaves.npy", "--tolerance", 2]
    done = surefix_(*arguments, *chosen, "--accept", 0.8, "--format", "json")
    found = [json.loads(line) for line in done.stdout.splitlines()]
    names = ("place", "confidence", "off_map", "speed", "place_low", "place_high")
    assert [tuple(row[name] for name in names) for row in found] == [
        (track.place, track.confidence, track.off_map, track.speed, *track.interval)
        for track in tracks
    ]
    accepted = [track.confidence >= 0.8 for track in tracks]
    assert 0 < sum(accepted) < len(accepted)
    assert [row["accepted"] for row in found] == accepted
    assert [(row["sequence_place"], row["sequence_score"]) for row in found] == [
        (fix.sequence and fix.sequence.place, fix.sequence and fix.sequence.score) for fix in fixes
    ]

    off = sum(track.off_map > 0.2 for track in tracks)
    unsure = sum(track.confidence < 0.5 for track in tracks)
    assert 5 < off < 60, "this drive leaves the map"
    sure = np.median([track.confidence for track in tracks])
    speeds = [track.speed for track in tracks]
    pace = np.median([np.mean(speeds[k : k + 10]) for k in range(len(speeds) - 9)])
    counts, said = done.stderr.splitlines()
    assert counts.startswith(f"150 fixes, {sum(fix.trusted for fix in fixes)} trusted (")
    share = f"{sum(accepted)} accepted at 0.8 ({sum(accepted) / 150:.0%})"
    lost = f"{unsure} below 0.5, {off} perhaps off the map"
    pace_said = f"usual pace {pace:.2g} places a frame"
    assert said == f"track: median confidence {sure:.2f}, {share}, {lost}, {pace_said}"

    rows = list(csv.DictReader(surefix_(*arguments, *chosen).stdout.splitlines()))
    assert "accepted" not in rows[0]
    assert [float(row["confidence"]) for row in rows] == [track.confidence for track in tracks]


def test_the_paper_alone_has_no_track(drive: Path) -> None:
    arguments = ["run", drive / "route.safetensors", drive / "leaves.npy", "--motion", "none"]
    done = surefix_(*arguments)
    rows = list(csv.DictReader(done.stdout.splitlines()))
    run = surefix.match(
        surefix.Map.open(drive / "route.safetensors"), np.load(drive / "leaves.npy")
    )
    assert [int(row["place"]) for row in rows[1:]] == run.place[1:].tolist()
    assert "confidence" not in rows[0]
    assert "track:" not in done.stderr


WARNED: dict[str, tuple[list[Any], str, str]] = {
    "a drive at three times the rate": (
        ["thrice.npy", "--motion", "steady"],
        "motion",
        "use --motion any, or give --odometry",
    ),
    "odometry that counts thrice": (
        ["even.npy", "--odometry", "poses.txt", "--places-per-metre", 3],
        "odometry",
        "look at its scale (--places-per-metre) and its clock",
    ),
}
FINE: dict[str, list[Any]] = {
    "the rate of the map": ["even.npy", "--motion", "steady"],
    "any motion": ["thrice.npy"],
    "right odometry": ["even.npy", "--odometry", "poses.txt", "--places-per-metre", 1],
    "off the map": ["leaves.npy"],
}


@pytest.mark.parametrize("name", [*WARNED, *FINE])
def test_a_warning_says_that_trusted_matches_disagree_with_the_motion(
    name: str, drive: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(drive)
    said = surefix_(
        "run", "route.safetensors", *(WARNED[name][0] if name in WARNED else FINE[name])
    )
    warnings = [line for line in said.stderr.splitlines() if line.startswith("warning: ")]
    if name in FINE:
        assert warnings == []
    else:
        _, against, advice = WARNED[name]
        expected = rf"warning: trusted matches disagree with the {against} in (\d+) of (\d+) pairs "
        (line,) = warnings
        counts = re.match(expected, line)
        assert counts
        assert line.endswith(advice)
        assert 0.6 * int(counts[2]) < int(counts[1]) <= int(counts[2])


def test_pairs_are_those_of_the_definition(drive: Path) -> None:
    """All pairs once more, from a list of all fixes."""
    localizer = surefix.Localizer(
        surefix.Map.open(drive / "route.safetensors"), motion="steady", tolerance=2
    )
    agreement = Agreement(tolerance=2)
    fixes, broken = [], 0
    starts = []
    generator = np.random.default_rng(3)
    for index, row in enumerate(np.load(drive / "thrice.npy")):
        lost = generator.random() < 0.02
        broken = index if lost else broken
        fixes.append(localizer.push(row, trusted=bool(generator.random() < 0.5)))
        starts.append(broken)
        agreement.add(fixes[-1], lost)
    moved = np.cumsum([fix.speed for fix in fixes])
    agreed = forwards = backwards = 0
    for j, fix in enumerate(fixes):
        before = [i for i in range(max(starts[j], j - 20), j - 7) if fixes[i].trusted]
        if not fix.trusted or not before:
            continue
        i = before[-1]
        places = fix.single.place - fixes[i].single.place
        if abs(places - (moved[j] - moved[i])) <= 2 + (j - i) / 3:
            agreed += 1
        elif abs(places) <= 6 * (j - i):
            forwards, backwards = forwards + (places >= -2), backwards + (places < -2)
    assert len(set(starts)) > 1
    assert (agreement.agreed, agreement.forwards, agreement.backwards) == (
        agreed,
        forwards,
        backwards,
    )
    assert forwards > 10


MISTAKES: dict[str, tuple[list[Any], str]] = {
    "above 1": (["--accept", 1.5], "--accept: expected a confidence from 0 to 1, got 1.5"),
    "no number": (["--accept", "nan"], "--accept: expected a confidence from 0 to 1, got nan"),
    "nothing to accept": (
        ["--accept", 0.9, "--motion", "none"],
        "--accept: expected --motion other than none",
    ),
    "another motion": (["--motion", "x"], "'x' is not one of 'steady', 'free', 'any', 'none'"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_gets_one_message(name: str, drive: Path) -> None:
    options, words = MISTAKES[name]
    done = surefix_("run", drive / "route.safetensors", drive / "even.npy", *options, code=2)
    assert words in re.sub(r"[\s│]+", " ", done.stderr), done.stderr
    assert done.stdout == ""


def test_the_help_says_the_default() -> None:
    said = {
        command: re.sub(r"[\s│]+", " ", surefix_(command, "--help").stdout)
        for command in ("run", "eval")
    }
    assert "at any speed; any by default" in said["run"]
    assert "at any speed; none by default" in said["eval"]


def test_several_maps_are_fused(tmp_path: Path) -> None:
    road = Route(places=40, size=(96, 48))
    summer, winter = np.stack(list(road.reference())), np.stack(list(road.revisit()))
    maps = [surefix.Map.from_images(summer, sad) for sad in (surefix.Sad(), surefix.Sad(patch=16))]
    names = [tmp_path / "coarse.safetensors", tmp_path / "fine.safetensors"]
    for place_map, name in zip(maps, names, strict=True):
        place_map.save(name)
    np.save(tmp_path / "winter.npy", winter)
    run = (names[0], tmp_path / "winter.npy", "--fuse", names[1], "--format", "json")
    done = surefix_("run", *run)
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    localizer = surefix.Localizer(maps, motion="any")
    fixes = [localizer.push(image) for image in winter]
    assert [row["place"] for row in rows] == [fix.place for fix in fixes]
    assert [row["confidence"] for row in rows] == [fix.confidence for fix in fixes]

    surefix.Map.from_images(summer[:30]).save(tmp_path / "short.safetensors")
    refused = surefix_("run", *run[:3], tmp_path / "short.safetensors", code=1)
    assert re.search(
        r"--fuse .*short.safetensors: expected a map of 40 places, got 30", refused.stderr
    )
