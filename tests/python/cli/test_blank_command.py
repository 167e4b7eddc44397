"""What the commands say of places and frames that show nothing."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import surefix
from commands import surefix_
from surefix.simulate import Route

DARK = [3, 10, 11]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map's images with three dark ones, and a drive whose camera goes dark and then freezes."""
    folder = tmp_path_factory.mktemp("dark")
    road = Route(places=60, size=(128, 64), seed=1)
    for name, drive in (("map", road.reference()), ("drive", road.revisit())):
        (folder / name).mkdir()
        images = [np.asarray(image) for image in drive]
        for at in DARK if name == "map" else range(20, 25):
            images[at] = np.zeros_like(images[at])
        if name == "drive":
            images[40:55] = [images[40]] * 15
        for at, image in enumerate(images):
            Image.fromarray(image).save(folder / name / f"{at:03}.png")
    return folder


def test_a_map_names_them_when_it_is_built(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "route.safetensors"
    done = surefix_("map", "build", folder / "map", "-o", out)
    assert "3 places show nothing: 3 (003.png), 10 (010.png), 11 (011.png)" in done.stdout
    assert "--skip-blank" in done.stdout
    done = surefix_("map", "info", out)
    assert "3 places show nothing: 3 (003.png), 10 (010.png)" in " ".join(done.stdout.split())
    assert json.loads(surefix_("map", "info", out, "--json").stdout)["blank"] == DARK
    done = surefix_("map", "append", out, folder / "map")
    assert "; 3 places show nothing: 63 (003.png), 70 (010.png)" in done.stdout
    done = surefix_("map", "build", folder / "map", "-o", out, "--skip-blank")
    assert "57 places" in done.stdout
    assert "3 places show nothing: 3 (003.png), 10 (010.png), 11 (011.png): left out" in done.stdout
    route = surefix.Map.open(out)
    assert (len(route), route.blank.size) == (57, 0)
    assert "blank      none" in surefix_("map", "info", out).stdout or route.blank.size == 0


def test_many_are_counted_and_the_first_named(tmp_path: Path) -> None:
    rows = np.random.default_rng(0).normal(size=(30, 32)).astype(np.float32)
    rows[5:14] = 0
    np.save(tmp_path / "rows.npy", rows)
    out = tmp_path / "route.safetensors"
    done = surefix_("map", "build", tmp_path / "rows.npy", "-o", out)
    assert "9 places show nothing: 5, 6, 7, 8, 9, 4 more" in done.stdout
    done = surefix_("map", "build", tmp_path / "rows.npy", "-o", out, "--skip-blank")
    assert "21 places" in done.stdout
    done = surefix_("map", "build", tmp_path / "rows.npy", "-o", out, "--post", "pca:8")
    assert "9 places show nothing" in done.stdout, "zeros of 32 numbers, whatever they become"


@pytest.mark.parametrize("motion", ["any", "none"])
def test_a_run_counts_dark_frames_and_notices_frozen_ones(
    folder: Path, tmp_path: Path, motion: str
) -> None:
    out = tmp_path / "route.safetensors"
    surefix_("map", "build", folder / "map", "-o", out)
    done = surefix_("run", out, folder / "drive", "--motion", motion)
    rows = list(csv.DictReader(io.StringIO(done.stdout)))
    assert [at for at, row in enumerate(rows) if row["blank"] == "true"] == [*range(20, 25)]
    assert not any(row["blank"] == row["trusted"] == "true" for row in rows)
    assert "5 blank" in done.stderr
    assert "warning: the camera is frozen: 14 frames repeat the one before, 41 to 54" in done.stderr
    done = surefix_("run", out, folder / "map", "--motion", motion, "--format", "json")
    found = [json.loads(line)["blank"] for line in done.stdout.splitlines()]
    assert [at for at, blank in enumerate(found) if blank] == DARK
    assert "frozen" not in done.stderr


def test_a_screen_is_unused_if_places_show_nothing(tmp_path: Path) -> None:
    rows = np.random.default_rng(0).normal(size=(30, 300)).astype(np.float32)
    np.save(tmp_path / "drive.npy", rows[:5])
    rows[7] = 0
    surefix.Map.from_descriptors(rows).save(tmp_path / "route")
    arguments = ("run", tmp_path / "route", tmp_path / "drive.npy", "--motion", "none")
    done = surefix_(*arguments, "--screen", "i8")
    assert "--screen: unused, for the sake of 1 place" in done.stderr


def test_exported_fixes_have_the_column(tmp_path: Path) -> None:
    D = np.random.default_rng(0).random((9, 6), np.float32)
    D[:, 2] = 0.5
    run = surefix.match_distances(D)
    run.to_csv(tmp_path / "fixes.csv")
    with (tmp_path / "fixes.csv").open() as file:
        assert [row["blank"] for row in csv.DictReader(file)] == ["false"] * 2 + ["true"] + [
            "false"
        ] * 3
    assert run.to_dataframe()["blank"].tolist() == run.blank.tolist()
