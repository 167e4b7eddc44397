"""The commands with recordings: maps made of them and made longer, and what they say."""

import json
import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import surefix
from commands import surefix_
from recordings import Bag, write_video
from surefix.cli.views import _references
from surefix.simulate import Route

PLACES = 40


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive as a folder of images, a video and two bags, and the maps of it."""
    folder = tmp_path_factory.mktemp("drive")
    images = [*Route(places=PLACES, size=(96, 48)).reference()]
    (folder / "images").mkdir()
    (folder / "bags").mkdir()
    for index, image in enumerate(images):
        Image.fromarray(image).save(folder / "images" / f"frame{index}.png")
    write_video(folder / "drive.mkv", images)
    for name, part in (("a.bag", range(20)), ("b.bag", range(20, PLACES))):
        with Bag(folder / "bags", "ros1", name) as bag:
            for index in part:
                at = 100 + index / 8
                bag.image("/camera", images[index], at)
                bag.image("/depth", np.ones((4, 6), np.uint16), at, encoding="16UC1")
                bag.pose("/odom", "nav_msgs/msg/Odometry", (2.0 * index, 0, 0), at)
    return folder


def made(drive: Path, out: Path, *arguments: object) -> tuple[surefix.Map, str]:
    """The map, and the line that says so."""
    said = surefix_("map", "build", *arguments, "-o", out).stdout
    return surefix.Map.open(out), said


def test_a_split_bag_is_one_route_and_says_what_it_passed_over(drive: Path, tmp_path: Path) -> None:
    whole, _ = made(drive, tmp_path / "images", drive / "images")
    for place in (drive / "bags", drive / "bags" / "*.bag"):
        route, said = made(drive, tmp_path / "route", place)
        assert np.array_equal(route.descriptors, whole.descriptors)
        assert said.count("\n") == 1
        assert said.rstrip().endswith(
            "; images of /camera; passed over: /depth (16UC1, no 8-bit image)"
        )
    fixes = surefix_("run", tmp_path / "route", drive / "bags", "-o", tmp_path / "fixes.csv")
    assert fixes.stderr.startswith("40 fixes, ")
    assert "passed over: /depth" in fixes.stderr.splitlines()[-1]


def test_a_map_grows_by_all_that_it_can_be_made_of(drive: Path, tmp_path: Path) -> None:
    whole, _ = made(drive, tmp_path / "whole", drive / "images")
    for place, options, count in (
        (drive / "images", [], 40),
        (drive / "drive.mkv", [], 40),
        (drive / "bags", [], 40),
        (drive / "drive.mkv", ["--every", 0.5], 8),
    ):
        made(drive, tmp_path / "route", drive / "images" / "frame?.png")
        said = surefix_("map", "append", tmp_path / "route", place, *options).stdout
        assert said.startswith(f"Added {count} places to ")
        longer = surefix.Map.open(tmp_path / "route")
        expected = whole.descriptors[:: PLACES // count]
        assert np.array_equal(longer.descriptors[10:], expected)


def test_a_map_grows_by_positions_of_a_bag(drive: Path, tmp_path: Path) -> None:
    sampled = ("--metres", 4, "--odometry", "/odom")
    made(drive, tmp_path / "route", drive / "bags" / "a.bag", *sampled)
    surefix_("map", "append", tmp_path / "route", drive / "bags" / "b.bag", *sampled)
    longer = surefix.Map.open(tmp_path / "route")
    assert longer.positions is not None
    assert longer.positions[:, 0].tolist() == [4.0 * index for index in range(20)]


def test_names_that_come_twice_are_said(drive: Path, tmp_path: Path) -> None:
    out = tmp_path / "route"
    made(drive, out, drive / "images")
    assert json.loads(surefix_("map", "info", out, "--json").stdout)["repeated"] == []
    assert "come before" not in surefix_("map", "info", out).stdout
    said = surefix_("map", "append", out, drive / "images").stdout
    assert said.rstrip().endswith(
        "; warning: 40 names were in the map before: frame0.png to frame39.png"
    )
    facts = json.loads(surefix_("map", "info", out, "--json").stdout)
    assert facts["names"] == ["frame0.png", "frame39.png"]
    assert facts["repeated"] == [[40, 79]]
    assert "places 40 to 79 have names that come before" in surefix_("map", "info", out).stdout


@pytest.mark.parametrize("place", ["images", "drive.mkv", "bags", "images/*.png"])
def test_references_are_whatever_the_map_was_made_of(
    place: str, drive: Path, tmp_path: Path
) -> None:
    out, queries = tmp_path / "route", drive / "drive.mkv"
    route, _ = made(drive, out, drive / place)
    found = _references(route, str(drive / place), None, True)
    if isinstance(found, dict):
        assert [*found] == [*range(PLACES)]
        first = surefix.read_image(drive / "images" / "frame0.png")
        assert np.array_equal(found[0], first)
    else:
        assert found == str(drive / place)
    # In a pipe, nothing is shown.
    done = surefix_("run", out, queries, "--references", drive / place, "-o", tmp_path / "fixes")
    assert done.stderr.startswith("40 fixes")
    for nothing in ("no", "bags/a.bag/x", "."):
        refused = surefix_("run", out, queries, "--references", drive / nothing, code=1).stderr
        assert re.search(r"^surefix: .*(expected|cannot)", refused, re.MULTILINE)


def test_a_report_shows_the_references_of_a_video(drive: Path, tmp_path: Path) -> None:
    made(drive, tmp_path / "route", drive / "drive.mkv")
    wrong = tmp_path / "truth.csv"
    wrong.write_text("query,reference\n" + "".join(f"{i},{(i + 20) % 40}\n" for i in range(PLACES)))
    options = ["--truth", wrong, "--method", "single", "-o", tmp_path / "out"]
    options += ["--references", drive / "drive.mkv"]
    surefix_("eval", tmp_path / "route", drive / "drive.mkv", *options)
    assert (tmp_path / "out" / "mistakes.png").is_file()
    # A map of other names.
    made(drive, tmp_path / "files", drive / "images")
    refused = surefix_("eval", tmp_path / "files", drive / "drive.mkv", *options, code=1).stderr
    assert "drive.mkv: expected images of the map, got none: its first is frame0.png" in refused


@pytest.mark.slow
def test_a_terminal_shows_the_references_of_a_video(drive: Path, tmp_path: Path) -> None:
    made(drive, tmp_path / "route", drive / "drive.mkv")
    arguments = [
        "run",
        tmp_path / "route",
        drive / "drive.mkv",
        "--references",
        drive / "drive.mkv",
    ]
    leader, follower = pty.openpty()
    command = [sys.executable, "-m", "surefix", *map(str, arguments)]
    environment = os.environ | {"TERM": "xterm-256color", "COLUMNS": "120", "LINES": "50"}
    with subprocess.Popen(
        command, stdout=follower, stderr=follower, stdin=follower, env=environment
    ) as process:
        os.close(follower)
        seen = b""
        while True:
            try:
                chunk = os.read(leader, 65536)
            except OSError:
                break
            if not chunk:
                break
            seen += chunk
        os.close(leader)
    assert process.returncode == 0, seen.decode()
    assert b"40 fixes" in seen


def test_large_references_are_kept_small(drive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from surefix.frames import by_name
    from surefix.frames import open as frames_open

    monkeypatch.setattr(by_name, "SMALLEST", 10)
    monkeypatch.setattr(by_name, "MEMORY", 3 * 32 * 32 * 4)
    found = by_name.images_by_name(frames_open(drive / "drive.mkv"), None, 4)
    assert [*found] == [0, 1, 2, 3]
    shapes: set[tuple[int, ...]] = {image.shape for image in found.values()}
    assert shapes == {(16, 32, 3)}


def test_a_damaged_bag_is_localized_as_far_as_it_goes(drive: Path, tmp_path: Path) -> None:
    images = [*Route(places=PLACES, size=(96, 48)).reference()]
    made(drive, tmp_path / "route", drive / "images")
    with Bag(tmp_path, "mcap", "winter") as bag:
        for index, image in enumerate(images):
            Image.fromarray(image).save(tmp_path / "one.png")
            data = (tmp_path / "one.png").read_bytes()
            bag.compressed("/camera", data[: 30 if index == 7 else None], "png", 100 + index / 8)
    done = surefix_("run", tmp_path / "route", bag.path, "-o", tmp_path / "fixes.csv")
    assert done.stderr.startswith("39 fixes")
    assert re.search(r"1 bad frame passed over: .*winter, /camera, message 7: ", done.stderr)
    again, said = made(drive, tmp_path / "again", bag.path)
    assert len(again) == 39
    assert again.names is not None
    assert again.names[7] == "8"
    assert "1 bad frame passed over: " in said


MISTAKES = {
    "a folder for a technique's map": (
        ["run", "@images", "@drive.mkv", "--fuse", "@images"],
        1,
        "images: expected a map, got a folder of images; make a map of it: surefix map build @images",
    ),
    "a folder to look at": (
        ["map", "info", "@images"],
        1,
        "a folder of images; make a map of it: surefix map build @images",
    ),
    "odometry in milliseconds": (
        ["map", "build", "@drive.mkv", "--metres", 2, "--odometry", "@ms.csv", "-o", "@m"],
        1,
        "got those of 0.0 s to 3900.0 s: are these milliseconds?",
    ),
    "odometry of another day": (
        ["map", "build", "@bags", "--metres", 2, "--odometry", "@wheels.csv", "-o", "@m"],
        1,
        "at the times of the frames, 100.0 s to 104.875 s, got those of 0.0 s to 3.9 s: are the",
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_gets_one_clear_message(name: str, drive: Path) -> None:
    rows = [(index / 10, 3 * index) for index in range(PLACES)]
    for file, unit in (("wheels.csv", 1), ("ms.csv", 1000)):
        lines = "".join(f"{time * unit},{along}\n" for time, along in rows)
        (drive / file).write_text("time,distance\n" + lines)
    arguments, code, words = MISTAKES[name]

    def at(word: object) -> str:
        return str(word).replace("@", f"{drive}/")

    done = surefix_(*map(at, arguments), code=code)
    assert at(words) in done.stderr
    assert "Traceback" not in done.stderr


def test_nanoseconds_are_taken_as_such_and_said(drive: Path, tmp_path: Path) -> None:
    for name, header, scale in (
        ("euroc.csv", "timestamp,x,y", None),
        ("ms.csv", "time_ms,x,y", 1e3),
        ("bracketed.csv", "t [ns],x,y", 1e9),
    ):
        start = 1_700_000_000 if scale is None else 0
        with Bag(tmp_path, "mcap", f"{name}.drive") as bag:
            for index in range(10):
                bag.image("/camera", np.full((8, 8, 3), index, np.uint8), start + 1 + index / 8)
        stamps = [(start + 1 + index / 8) * (scale or 1e9) for index in range(10)]
        lines = [f"{stamp:.0f},{2 * index},0" for index, stamp in enumerate(stamps)]
        (tmp_path / name).write_text("\n".join([header, *lines]))
        sampled = ("--metres", 4, "--odometry", tmp_path / name)
        route, said = made(drive, tmp_path / "route", bag.path, *sampled)
        assert route.names == ["0", "2", "4", "6", "8"]
        assert re.search(rf"; {tmp_path}/{re.escape(name)}: \w+.* in (milli|nano)seconds$", said)


def test_frames_outside_the_odometry_are_counted_and_named(drive: Path, tmp_path: Path) -> None:
    lines = [f"{index / 10},{3 * index}" for index in range(2, PLACES)]
    (tmp_path / "wheels.csv").write_text("\n".join(["time,distance", *lines]))
    sampled = ("--metres", 3, "--odometry", tmp_path / "wheels.csv")
    _, said = made(drive, tmp_path / "route", drive / "drive.mkv", *sampled)
    assert said.rstrip().endswith(
        "2 of 40 frames before its first or after its last time are passed over (0, 1); the "
        "odometry covers 0.2 s to 3.9 s, the frames 0.0 s to 3.9 s"
    )
    # Most of the drive is a warning.
    (tmp_path / "wheels.csv").write_text("\n".join(["time,distance", *lines[:9]]))
    _, said = made(drive, tmp_path / "route", drive / "drive.mkv", *sampled)
    assert "wheels.csv: warning: 31 of 40 frames" in said
    # A pause over which the robot moved.
    (tmp_path / "wheels.csv").write_text("\n".join(["time,distance", *lines[:9], *lines[30:]]))
    _, said = made(drive, tmp_path / "route", drive / "drive.mkv", *sampled)
    assert "21 frames in a pause of the odometry, such as 1.0 s to 3.2 s: positions" in said
