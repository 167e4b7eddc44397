"""Loop closure: the filter against its oracle, and the promises of `surefix.LoopCloser`."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import oracle_loops
import surefix
from oracle import Array
from surefix import LoopCloser, LoopClosure, Motion, Sad, SurefixFileError, SurefixValueError

EXACT = 1e-9


def circle(frames: int, around: int, dim: int = 32, seed: int = 0, noise: float = 0.5) -> Array:
    """Views of a circle of places, driven more than once."""
    random = np.random.default_rng(seed)
    places = random.random((around, dim))
    seen = places[np.arange(frames) % around]
    return (seen + noise * random.random((frames, dim))).astype(np.float32)


def pushed(closer: LoopCloser, rows: Array, advance: Array | None = None) -> list[LoopClosure]:
    steps = [None] * len(rows) if advance is None else [float(a) for a in advance]
    known = [None if a is None or np.isnan(a) else a for a in steps]
    return [closer.push(row, a) for row, a in zip(rows, known, strict=True)]


@pytest.mark.parametrize("metric", ["cosine", "euclidean", "manhattan"])
@pytest.mark.parametrize("motion", ["loops", "steady", "free", "any"])
def test_the_filter_is_that_of_the_oracle(metric: str, motion: str) -> None:
    drives: list[dict[str, Any]] = [{}, {"gaps": [70]}, {"blank": [20, 21, 75]}]
    random = np.random.default_rng(3)
    moved = np.where(random.random(110) < 0.5, random.normal(1, 0.5, 110), np.nan)
    drives.append({"advance": moved})
    for seed, drive in enumerate(drives):
        rows = circle(110, 45, seed=seed)
        rows[drive.get("blank", [])] = 0
        whole = surefix.Map.from_descriptors(np.append(rows, rows[:2] + 9, 0), metric)
        D = np.stack([whole.distances(row)[:-2] for row in rows], axis=1)
        kind = Motion(motion)
        want = oracle_loops.close(D, kind, 10, **drive)
        closer = LoopCloser(exclude=10, metric=metric, motion=motion, tolerance=2)
        for j, row in enumerate(rows):
            if j in drive.get("gaps", []):
                closer.gap()
            a = drive.get("advance", np.full(110, np.nan))[j]
            said = closer.push(row, None if np.isnan(a) else a)
            if j < 12:
                assert (said.place, said.confidence, said.off_map) == (0, 0.0, 1.0)
                continue
            n = j - 10
            np.testing.assert_allclose(closer.belief, want.belief[:n, j], rtol=0, atol=EXACT)
            assert said.off_map == pytest.approx(want.off[j], abs=EXACT)
            if np.ptp(np.sort(want.belief[:n, j])[-2:]) > EXACT:
                assert said.place == want.place(j)
                assert said.confidence == pytest.approx(want.confidence(j, 2), abs=EXACT)


def test_edges_are_what_lasts() -> None:
    rows = circle(150, 60, noise=0.1)
    closer = LoopCloser(exclude=10, lasting=4, confidence=0.8)
    said = pushed(closer, rows)
    sure = np.array([one.confidence >= 0.8 for one in said])
    edges = [edge.frame for edge in closer.edges]
    assert edges == [j for j in range(3, 150) if sure[j - 3 : j + 1].all()]
    assert edges
    assert all(edge == said[edge.frame] for edge in closer.edges)
    assert all(edge.frame % 60 == edge.place % 60 for edge in closer.edges)


def test_images_files_and_learned_descriptors(tmp_path: Path) -> None:
    class Mean:
        name = "mean"
        recipe: ClassVar[dict[str, object]] = {"name": "mean"}

        def describe(self, images: Any) -> Any:
            small = [surefix.Sad().thumbnail(image) for image in images]
            return np.stack([image.reshape(-1) for image in small]).astype(np.float32)

    random = np.random.default_rng(0)
    images = random.integers(0, 256, (30, 48, 64, 3), np.uint8)
    for descriptor in (None, Sad(dtype="f32"), Mean()):
        closer = LoopCloser(descriptor, exclude=5, lasting=2)
        for frame in range(60):
            said = closer.push(images[frame % 30])
        assert said.edge
        assert said.place == 29
        made = closer.to_map()
        assert len(closer) == len(made) == 60
        network = descriptor if isinstance(descriptor, Mean) else None
        assert surefix.Localizer(made, descriptor=network).push(images[7]).single.place == 7
    made.save(tmp_path / "drive.safetensors")
    assert surefix.Map.open(tmp_path / "drive.safetensors").recipe == {"name": "mean"}


def test_files_for_pose_graphs(tmp_path: Path) -> None:
    closer = LoopCloser(exclude=10)
    pushed(closer, circle(150, 60, noise=0.1))
    closer.to_csv(tmp_path / "loops.csv")
    table = np.loadtxt(tmp_path / "loops.csv", delimiter=",", skiprows=1)
    edges = [(edge.frame, edge.place, edge.confidence) for edge in closer.edges]
    np.testing.assert_array_equal(table, edges)

    angle = np.arange(150) * 2 * np.pi / 60
    x, y = 10 * np.cos(angle), 10 * np.sin(angle)
    closer.to_g2o(tmp_path / "plane.g2o", np.stack([x, y, angle + np.pi / 2], axis=1), first=7)
    lines = [line.split() for line in (tmp_path / "plane.g2o").read_text().splitlines()]
    vertices = {int(line[1]): np.array(line[2:], float) for line in lines if line[0][0] == "V"}
    read = [(int(a), int(b), np.array(rest, float)) for tag, a, b, *rest in lines if tag[0] == "E"]
    assert sorted(vertices) == list(range(7, 157))
    assert len(read) == 149 + len(edges)
    for a, b, numbers in read[:149]:
        # Each odometry edge leads from one vertex to the next.
        heading = vertices[a][2]
        turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
        np.testing.assert_allclose(vertices[a][:2] + turn @ numbers[:2], vertices[b][:2], atol=1e-9)
        assert b == a + 1
    for (a, b, numbers), (frame, place, confidence) in zip(read[149:], edges, strict=True):
        assert (a, b) == (7 + place, 7 + frame)
        np.testing.assert_allclose(numbers[[3, 6, 8]], confidence / np.array([4, 4, 0.04]))

    poses = np.zeros((150, 7))
    poses[:, 6] = 1
    closer.to_g2o(tmp_path / "space.g2o", poses)
    assert "EDGE_SE3:QUAT" in (tmp_path / "space.g2o").read_text()
    for bad, why in [(poses[:9], "poses"), (poses[:, :4], "poses"), (poses * 0, "poses")]:
        with pytest.raises(SurefixValueError, match=why):
            closer.to_g2o(tmp_path / "space.g2o", bad)
    assert "EDGE_SE3:QUAT" in (tmp_path / "space.g2o").read_text(), "the old file is kept"
    with pytest.raises(SurefixFileError):
        closer.to_csv(tmp_path / "no" / "folder.csv")
    LoopCloser().to_g2o(tmp_path / "none.g2o")
    assert (tmp_path / "none.g2o").read_text() == ""


def test_memory_is_announced_and_limited(tmp_path: Path) -> None:
    rows = circle(150, 60, dim=16384, noise=0.2)
    free, limited = LoopCloser(None, 10), LoopCloser(None, 10, memory=4 << 20, folder=tmp_path)
    for row in rows:
        assert free.push(row) == limited.push(row)
        assert limited.memory <= 4 << 20
    assert limited.in_file > 4 << 20
    assert free.in_file == 0
    assert list(tmp_path.iterdir()) == []
    np.testing.assert_array_equal(limited.to_map().descriptors, free.to_map().descriptors)
    before = free.memory
    free.reserve(100)
    assert free.memory - before > 80 * 16384 * 4


def test_what_does_not_fit_is_refused(tmp_path: Path) -> None:
    options: list[tuple[dict[str, Any], str]] = [
        ({"exclude": 0}, "option `exclude`: expected a whole number of 1 or more"),
        ({"exclude": -3}, "option `exclude`"),
        ({"lasting": 0}, "option `lasting`"),
        ({"confidence": 1.5}, "option `confidence`"),
        ({"motion": "fast"}, "option `motion`"),
        ({"metric": "hamming"}, "metric"),
        ({"folder": tmp_path / "no"}, "option `folder`: expected a folder"),
        ({"descriptor": "sad"}, "descriptor: expected a surefix.Sad"),
        ({"descriptor": Sad(), "memory": 1000}, "option `memory`: expected at least"),
    ]
    for given, why in options:
        with pytest.raises(SurefixValueError, match=why):
            LoopCloser(**given)
    closer = LoopCloser()
    with pytest.raises(SurefixValueError, match="expected a frame first"):
        closer.reserve(3)
    with pytest.raises(SurefixValueError, match="at least 2 places"):
        closer.to_map()
    row = np.arange(16, dtype=np.float32)
    closer.push(row)
    for bad in (row[:3], row.astype(np.uint8), np.full(16, np.nan, np.float32)):
        with pytest.raises(SurefixValueError):
            closer.push(bad)
    with pytest.raises(SurefixValueError):
        closer.push(np.zeros((32, 64), np.uint8))
    with pytest.raises(SurefixValueError):
        closer.push(row, advance=np.inf)
    assert (len(closer), closer.frames) == (1, 1)
    for copied in (pickle.dumps, copy.copy, copy.deepcopy):
        with pytest.raises(TypeError, match="cannot be pickled"):
            copied(closer)
    assert pickle.loads(pickle.dumps(closer.push(row))).frame == 1


def test_frozen_it_takes_no_more_places() -> None:
    rows = circle(150, 60, noise=0.1)
    closer = LoopCloser(exclude=10)
    pushed(closer, rows[:60])
    closer.freeze()
    pushed(closer, rows[60:])
    assert (closer.frozen, len(closer), closer.frames) == (True, 60, 150)
    assert {edge.place for edge in closer.edges} <= set(range(60))
    assert len(closer.edges) > 50
    closer.reset()
    assert (closer.frozen, len(closer), closer.frames, closer.edges) == (False, 0, 0, [])


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no folder that takes no files")
def test_a_folder_that_takes_no_files_leaves_it_as_it_was() -> None:
    rows = circle(300, 300, dim=4096)
    closer = LoopCloser(memory=3_000_000, folder="/proc")
    with pytest.raises(SurefixFileError, match="/proc: cannot create a file of places in"):
        pushed(closer, rows)
    count = len(closer)
    assert count == closer.frames
    assert count >= 64
    with pytest.raises(SurefixFileError):
        closer.push(rows[count])
    closer.freeze()
    assert closer.push(rows[count]).frame == count
