"""What a shell hands over: files that it lists for a pattern without quotes, one file, folders."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import surefix
from commands import surefix_
from surefix.simulate import Route

PLACES = 24


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two drives whose names do not sort by the alphabet, with a note beside the images."""
    folder = tmp_path_factory.mktemp("drives")
    route = Route(places=PLACES, size=(96, 48))
    for name, drive in (("monday", route.reference()), ("tues [day]", route.revisit())):
        (folder / name).mkdir()
        for index, image in enumerate(drive):
            Image.fromarray(image).save(folder / name / f"frame{index}.png")
        (folder / name / "notes.txt").write_text("sunny")
    surefix_("map", "build", folder / "monday", "-o", folder / "route.safetensors")
    return folder


def listed(folder: Path, pattern: str) -> list[str]:
    """As a shell lists them: by the alphabet."""
    return sorted(str(path) for path in folder.glob(pattern))


@pytest.mark.parametrize("pattern", ["*.png", "*", "frame*"])
def test_files_that_the_shell_lists_are_those_of_the_pattern(
    drives: Path, pattern: str, tmp_path: Path
) -> None:
    made = surefix_("map", "build", *listed(drives / "monday", pattern), "-o", tmp_path / "a")
    assert made.stdout.startswith(f"Made {tmp_path / 'a'}: {PLACES} places")
    assert ("notes.txt" in made.stdout or ".txt" in made.stdout) == (pattern == "*")
    known = surefix.Map.open(drives / "route.safetensors")
    assert surefix.Map.open(tmp_path / "a").names == known.names
    by_folder = surefix_("run", drives / "route.safetensors", drives / "tues [day]").stdout
    by_files = surefix_(
        "run", drives / "route.safetensors", *listed(drives / "tues [day]", pattern)
    ).stdout
    # But for the latencies.
    without = [
        [line.split(",")[:14] for line in text.splitlines()] for text in (by_folder, by_files)
    ]
    assert without[0] == without[1]
    assert len(without[0]) == 1 + PLACES


def test_some_of_them_are_taken_in_route_order(drives: Path) -> None:
    for pattern, numbers in {"frame1?.png": range(10, 20), "frame[579]*.png": (5, 7, 9)}.items():
        some = listed(drives / "tues [day]", pattern)
        rows = surefix_("run", drives / "route.safetensors", *some).stdout.splitlines()[1:]
        assert [row.split(",")[1] for row in rows] == [f"frame{number}.png" for number in numbers]
    given = [drives / "monday/frame11.png", drives / "monday/frame3.png"]
    made = drives / "two.safetensors"
    surefix_("map", "build", *given, "-o", made)
    assert surefix.Map.open(made).names == ["frame3.png", "frame11.png"]


def test_other_lists_are_refused_with_what_is_taken(drives: Path) -> None:
    for given in (
        [drives / "monday", drives / "tues [day]"],
        [drives / "monday/frame1.png", drives / "tues [day]/frame3.png"],
        [drives / "monday/frame1.png", drives / "monday/frame99.png"],
    ):
        done = surefix_("run", drives / "route.safetensors", *given, code=2)
        assert "or images of one folder, got" in " ".join(done.stderr.replace("│", " ").split())


@pytest.mark.parametrize("command", ["align", "audit", "eval", "tune"])
def test_each_command_takes_them(drives: Path, command: str, tmp_path: Path) -> None:
    options = {"eval": ["--truth", "identity"], "audit": []}.get(command, [])
    out = {"align": "truth.csv", "eval": "report", "tune": "route.toml"}.get(command)
    options += ["-o", str(tmp_path / out)] if out else []
    files = listed(drives / "tues [day]", "*.png")
    surefix_(command, drives / "route.safetensors", *files, *options)


def test_one_image_is_a_drive(drives: Path) -> None:
    file = drives / "tues [day]" / "frame7.png"
    (row,) = surefix_("run", drives / "route.safetensors", file).stdout.splitlines()[1:]
    assert row.split(",")[1:3] == ["frame7.png", "7"]
    assert surefix.find_images(file) == [str(file)]
    (fix,) = surefix.Localizer(surefix.Map.open(drives / "route.safetensors")).stream(file)
    assert fix.place == 7
    surefix_("map", "build", file, code=1)


def test_every_nth_of_a_folder_or_an_array(drives: Path, tmp_path: Path) -> None:
    names = [f"frame{index}.png" for index in range(0, PLACES, 5)]
    surefix_("map", "build", drives / "monday", "--stride", 5, "-o", tmp_path / "a")
    assert surefix.Map.open(tmp_path / "a").names == names
    rows = surefix_("run", drives / "route.safetensors", drives / "monday", "--stride", 5).stdout
    assert [row.split(",")[1] for row in rows.splitlines()[1:]] == names
    np.save(tmp_path / "rows.npy", np.random.default_rng(0).normal(size=(20, 16)))
    surefix_("map", "build", tmp_path / "rows.npy", "--stride", 2, "-o", tmp_path / "b")
    expected = np.load(tmp_path / "rows.npy")[::2].astype(np.float32)
    np.testing.assert_array_equal(surefix.Map.open(tmp_path / "b").descriptors, expected)
