"""``surefix demo --town``: a map of three roads in two seasons, and the page of a drive on it."""

import csv
import subprocess
from pathlib import Path

import numpy as np
import pytest

import surefix

pytest.importorskip("matplotlib")

from commands import surefix_process
from html_reader import read
from surefix.report.town import FILES
from surefix.simulate import Town
from surefix.study.town import BEST, ONE_LINE, SUMMER, TownDemo, drive_through

pytestmark = pytest.mark.slow

PLACES, SIZE = 120, (96, 48)


@pytest.fixture(scope="module")
def demo() -> TownDemo:
    return drive_through(PLACES, SIZE, seed=1)


def test_a_drive_goes_in_round_and_out() -> None:
    town = Town(60, (32, 16), seed=3)
    drive = town.drive()
    assert drive.truth.tolist() == [*range(20, 44), *range(20), *range(11), *range(44, 60)]
    assert drive.junctions == (24, 44, 55)
    assert len(drive) == len(drive.images) == 71
    steps = np.linalg.norm(np.diff(town.positions[drive.truth], axis=0), axis=1)
    assert (steps > 2.5).all()
    assert (steps < 3.5).all()
    with pytest.raises(surefix.SurefixValueError, match="places: expected at least 40"):
        Town(39)


def test_a_town_is_better_than_a_line_and_two_seasons_than_one(demo: TownDemo) -> None:
    right = {name: flags.mean() for name, flags in demo.right.items()}
    assert right[BEST] > 0.95
    assert right[BEST] > right[ONE_LINE] + 0.02
    assert right[BEST] >= right[SUMMER]
    assert max(demo.after_junctions(BEST)) < max(demo.after_junctions(ONE_LINE))


@pytest.fixture(scope="module")
def made(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[Path, subprocess.CompletedProcess[str]]:
    folder = tmp_path_factory.mktemp("town")
    options = ["--places", str(PLACES), "--width", "96", "--height", "48"]
    return folder, surefix_process("demo", "--town", *options, "-o", str(folder))


def test_the_page_and_its_files_are_there_and_agree(
    made: tuple[Path, subprocess.CompletedProcess[str]], demo: TownDemo
) -> None:
    folder, said = made
    assert {path.name for path in folder.iterdir()} == {*FILES}
    with (folder / "fixes.csv").open(newline="") as file:
        place = [int(row["place"]) for row in csv.DictReader(file)]
    assert place == demo.run.place.tolist()
    right = int(demo.right[BEST].sum())
    assert f"On the map of the town: {right} of {len(place)} fixes right" in said.stdout
    page = read((folder / "report.html").read_text(encoding="utf-8"))
    assert f"{right} of {len(place)}" in page.text
    known = surefix.Map.open(folder / "town.safetensors")
    assert known.segments == demo.town.segments
    assert len(known.traverses) == 2
