"""`surefix loops`: edges as they are found, and files for pose graphs."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import surefix
from commands import surefix_


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A circle of 40 images, twice."""
    images = np.random.default_rng(0).integers(0, 256, (40, 48, 64), np.uint8)
    file = tmp_path_factory.mktemp("loops") / "drive.npy"
    np.save(file, np.concatenate([images, images]))
    return file


def test_edges_are_printed_and_written(drive: Path, tmp_path: Path) -> None:
    options = (drive, "--exclude", 10, "--lasting", 3)
    done = surefix_("loops", *options)
    rows = list(csv.DictReader(done.stdout.splitlines()))
    closer = surefix.LoopCloser(surefix.Sad(), 10, lasting=3)
    for image in np.load(drive):
        closer.push(image)
    said = [(str(e.frame), str(e.place), str(e.confidence)) for e in closer.edges]
    assert [(row["frame"], row["place"], row["confidence"]) for row in rows] == said
    assert len(said) > 20
    assert rows[0]["frame_name"] != rows[0]["place_name"]
    assert f"80 frames, {len(said)} edges in 1 stretch" in done.stderr

    out = tmp_path / "loops.csv"
    done_again = surefix_("loops", *options, "-o", out)
    assert (out.read_text(), done_again.stdout) == (done.stdout, "")
    graph = tmp_path / "loops.g2o"
    surefix_("loops", *options, "-o", graph)
    lines = graph.read_text().splitlines()
    assert len(lines) == len(said)
    assert all(line.startswith("EDGE_SE2 ") for line in lines)


def test_wrong_use_is_refused(drive: Path, tmp_path: Path) -> None:
    for options, why in [
        (("-o", tmp_path / "loops.txt"), "--out: expected a name that ends in .csv or .g2o"),
        (("--metres", 2), "--metres: expected --odometry too"),
        (("--odometry", "track.csv"), "--odometry: expected --metres"),
        (("--folder", tmp_path / "no"), "--folder: expected a folder, got"),
        (("--output", "x"), "--output: expected --model too"),
        (("--exclude", 0), "--exclude"),
    ]:
        done = surefix_("loops", drive, *options, code=2)
        assert why in " ".join(done.stderr.replace("│", " ").split())
    done = surefix_("loops", drive, "--folder", tmp_path, "--memory", 1, code=1)
    assert "memory" in done.stderr
    assert "surefix loops todays_photos/" in surefix_("loops", "--help").stdout
