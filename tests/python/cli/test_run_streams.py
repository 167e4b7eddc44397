"""`surefix run` on videos, bags and folders that grow."""

import csv
import io
import json
import os
import pty
import re
import signal
import subprocess
import sys
import time
from collections.abc import Generator
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import ANY

import numpy as np
import pytest
from PIL import Image

import surefix
from commands import surefix_, surefix_process
from recordings import Bag, write_video
from surefix.cli.fixes import Summary
from surefix.cli.run import localize
from surefix.descriptors import mapping
from surefix.frames import Frame, Frames, KeepNewest, Shot
from surefix.frames import open as frames_open
from surefix.simulate import Route
from surefix.tables.fix_files import json_writer

PLACES = 40
PLAIN = "frame query place place_name score trusted blank ready anchors speed single_place single_distance gradient_place"
COLUMNS = [*PLAIN.split(), "gradient_value", "latency_us"]
WHERE = ["segment", "segment_place"]
TRACK = ["confidence", "off_map", "place_low", "place_high", "sequence_place", "sequence_score"]


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(text.splitlines()))


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map, and a second drive as a folder, a video and a bag: 10 frames a second, with a halt and
    a break.
    """
    folder = tmp_path_factory.mktemp("drive")
    route = Route(places=PLACES, size=(96, 48))
    surefix.Map.from_images(route.reference(), progress=False).save(folder / "route.safetensors")
    revisit = route.revisit()
    images = [revisit[index] for index in range(PLACES)]
    (folder / "images").mkdir()
    for index, image in enumerate(images):
        Image.fromarray(image).save(folder / "images" / f"{index}.png")
    write_video(folder / "drive.mkv", images)
    with Bag(folder, "ros1") as bag:
        for index, image in enumerate(images):
            # A break of 5 seconds before frame 20.
            at = 1_700_000_000 + index / 8 + 5 * (index >= 20)
            bag.image("/camera", image, at)
            bag.pose("/odom", "nav_msgs/msg/Odometry", (2.0 * index, 0, 0), at)
    (folder / "wheels.csv").write_text(
        "time,distance\n" + "".join(f"{i / 10},{3 * i}\n" for i in range(PLACES))
    )
    return folder


def same(a: list[dict[str, str]], b: list[dict[str, str]]) -> bool:
    """Without the names, the latencies, and the columns that only a stream has."""
    compared = [column for column in COLUMNS if column not in ("query", "latency_us")]
    return [[row[column] for column in compared] for row in a] == [
        [row[column] for column in compared] for row in b
    ]


def test_a_video_and_a_bag_give_the_fixes_of_their_images(drive: Path) -> None:
    route = drive / "route.safetensors"
    alone = rows(surefix_("run", route, drive / "images", "--motion", "none").stdout)
    assert list(alone[0]) == COLUMNS + WHERE, "of the paper alone"
    expected = rows(surefix_("run", route, drive / "images").stdout)
    assert list(expected[0]) == [*COLUMNS, *TRACK, *WHERE]
    for place, start in (("drive.mkv", 0), ("drive.bag", 1_700_000_000)):
        done = surefix_("run", route, drive / place)
        found = rows(done.stdout)
        assert list(found[0]) == [*COLUMNS, "time", "dropped", "gap", *TRACK, *WHERE]
        assert same(found, expected)
        assert [row["query"] for row in found] == [str(index) for index in range(PLACES)]
        assert float(found[0]["time"]) == start
        assert {(row["dropped"], row["gap"]) for row in found} == {("0", "false")}
        assert re.match(r"40 fixes, \d+ trusted \(\d+%\), latency p50", done.stderr)


def test_frames_are_passed_over_by_number_time_and_distance(drive: Path) -> None:
    route = drive / "route.safetensors"
    options: dict[str, tuple[list[Any], list[int]]] = {
        "stride": (["--stride", 3], list(range(0, PLACES, 3))),
        "every": (["--every", 0.5], list(range(0, PLACES, 5))),
        "metres": (["--metres", 6, "--odometry", drive / "wheels.csv"], list(range(0, PLACES, 2))),
    }
    for given, expected in options.values():
        found = rows(surefix_("run", route, drive / "drive.mkv", *given).stdout)
        assert [int(row["query"]) for row in found] == expected
    lines = surefix_(
        "run", route, drive / "drive.bag", "--metres", 4, "--odometry", "/odom", "--format", "json"
    ).stdout
    found_json = [json.loads(line) for line in lines.splitlines()]
    assert [int(row["query"]) for row in found_json] == list(range(0, PLACES, 2))
    assert found_json[1]["time"] == 1_700_000_000.25


def test_a_gap_breaks_the_diagonal_and_is_said(drive: Path) -> None:
    arguments = ["run", drive / "route.safetensors", drive / "drive.bag", "-L", 4]
    done = surefix_(*arguments, "--gap", 1)
    found = rows(done.stdout)
    assert [row["query"] for row in found if row["gap"] == "true"] == ["20"]
    warming = [int(row["query"]) for row in found if row["ready"] == "false"]
    assert warming == [0, 1, 2, 20, 21, 22]
    assert ", 1 gaps, latency" in done.stderr or ", 1 gap, latency" in done.stderr
    whole = rows(surefix_(*arguments).stdout)
    assert [int(row["query"]) for row in whole if row["ready"] == "false"] == [0, 1, 2]
    assert same(found[:20], whole[:20])


def test_dropped_frames_are_counted_in_the_rows_and_in_the_summary(drive: Path) -> None:
    done = surefix_("run", drive / "route.safetensors", drive / "images", "--newest")
    found = rows(done.stdout)
    assert list(found[0]) == [*COLUMNS, "time", "dropped", "gap", *TRACK, *WHERE]
    dropped = sum(int(row["dropped"]) for row in found)
    assert len(found) + dropped == PLACES
    assert found[-1]["query"] == "39.png"
    said = re.search(r", (\d+) frames? dropped,", done.stderr)
    assert (int(said[1]) if said else 0) == dropped


def test_a_damaged_video_keeps_the_fixes_so_far(drive: Path, tmp_path: Path) -> None:
    data = (drive / "drive.mkv").read_bytes()
    (tmp_path / "cut.mkv").write_bytes(data[: len(data) // 2])
    out = tmp_path / "fixes.csv"
    run = ("run", drive / "route.safetensors", tmp_path / "cut.mkv", "-o", out)
    done = surefix_(*run, "--strict", code=1)
    kept = tmp_path / "fixes.part.csv"
    found = rows(kept.read_text())
    assert 0 < len(found) < PLACES
    assert not out.exists()
    summary, track, stopped, error = done.stderr.splitlines()
    assert stopped == f"stopped: the rows so far are in {kept}, not in {out}"
    assert track.startswith("track: median confidence ")
    assert summary.startswith(f"{len(found)} fixes, ")
    assert error.startswith(f"surefix: {tmp_path / 'cut.mkv'}, frame {len(found)}: a damaged video")
    assert same(
        found,
        rows(surefix_("run", drive / "route.safetensors", drive / "images").stdout)[: len(found)],
    )
    done = surefix_(*run)
    assert rows(out.read_text()) == [row | {"latency_us": ANY} for row in found]
    assert done.stderr.splitlines()[-1].startswith("1 bad frame passed over: ")


def test_images_that_change_size_are_nothing_to_a_sad_map(drive: Path, tmp_path: Path) -> None:
    for index in range(4):
        image = Image.open(drive / "images" / f"{index}.png")
        image.resize((96, 48) if index < 2 else (192, 96)).save(tmp_path / f"{index}.png")
    found = rows(surefix_("run", drive / "route.safetensors", tmp_path).stdout)
    assert [row["query"] for row in found] == [f"{index}.png" for index in range(4)]


class Changing(Frames):
    """Ready descriptors of 5 numbers, and then one of 7."""

    def shots(self) -> Generator[Shot, None, None]:
        for index in range(4):
            row = np.ones(7 if index == 3 else 5, np.float32)
            yield Shot(None, f"row {index}", partial(np.asarray, row))


def test_a_change_of_size_that_cannot_be_used_is_named_with_both_sizes() -> None:
    localizer = surefix.Localizer(surefix.Map.from_descriptors(np.eye(4, 5, dtype=np.float32)))
    summary = Summary()
    with pytest.raises(
        surefix.SurefixValueError, match=r"^row 3: the images change size here, from 5 to 7: .*5.*7"
    ):
        localize(localizer, Changing(), json_writer(io.StringIO()), summary)
    assert summary.lines(None)[0].startswith("3 fixes, ")


@pytest.mark.slow
def test_a_file_that_is_no_image_does_not_end_a_run_that_follows(
    drive: Path, tmp_path: Path
) -> None:
    for index in range(4):
        (tmp_path / f"{index}.png").write_bytes((drive / "images" / f"{index}.png").read_bytes())
    (tmp_path / "2.png").write_bytes(b"not an image")
    done = surefix_process(
        "run", drive / "route.safetensors", tmp_path, "--follow", "--idle", "0.5"
    )
    assert [(row["query"], row["dropped"], row["ready"]) for row in rows(done.stdout)] == [
        ("0.png", "0", "false"),
        ("1.png", "0", "true"),
        ("3.png", "1", "false"),
    ]
    said, summary, _ = done.stderr.splitlines()
    assert said.startswith(f"Passed over: image {tmp_path / '2.png'}: ")
    assert re.match(r"3 fixes, .*1 frame dropped, ", summary)
    for index in (0, 1, 3):
        (tmp_path / f"{index}.png").unlink()
    done = surefix_process(
        "run", drive / "route.safetensors", tmp_path, "--follow", "--idle", "0.5"
    )
    assert done.stderr.splitlines()[1:] == ["0 fixes: there was no query that could be used"]


def test_one_fix_is_in_the_singular() -> None:
    localizer = surefix.Localizer(surefix.Map.from_descriptors(np.eye(4, 5, dtype=np.float32)))
    summary = Summary()
    stream = KeepNewest([Frame(np.arange(5, dtype=np.float32), 1.0, "0", 1, True)], 1)  # type: ignore[arg-type]
    localize(localizer, stream, None, summary)
    assert re.match(
        r"1 fix, \d trusted \(\d+%\), 1 frame dropped, 1 gap, latency", summary.lines(None)[0]
    )


@pytest.mark.slow
def test_a_folder_that_grows_is_followed_until_it_rests(drive: Path, tmp_path: Path) -> None:
    arguments = ["run", drive / "route.safetensors", tmp_path, "--follow", "--idle", "4"]
    command = [sys.executable, "-m", "surefix", *map(str, arguments)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        for index in range(12):
            (tmp_path / f"{index}.png").write_bytes(
                (drive / "images" / f"{index}.png").read_bytes()
            )
            time.sleep(0.05)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    found = rows(out)
    assert [row["query"] for row in found] == [f"{index}.png" for index in range(12)]
    assert same(
        found, rows(surefix_("run", drive / "route.safetensors", drive / "images").stdout)[:12]
    )
    assert [float(row["time"]) for row in found] == [
        (tmp_path / row["query"]).stat().st_mtime for row in found
    ]


@pytest.mark.slow
def test_ctrl_c_is_how_following_ends(drive: Path, tmp_path: Path) -> None:
    out, part = tmp_path / "fixes.csv", tmp_path / ".fixes.csv.part"
    arguments = ["run", drive / "route.safetensors", drive / "images", "--follow", "-o", out]
    command = [sys.executable, "-m", "surefix", *map(str, arguments)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        until = time.monotonic() + 60
        while (
            not (part.exists() and len(part.read_text().splitlines()) == 1 + PLACES)
            and time.monotonic() < until
        ):
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 0
    assert err.startswith("40 fixes, ")
    assert err.count("\n") == 2
    assert len(out.read_text().splitlines()) == 1 + PLACES
    assert not part.exists()


@pytest.mark.slow
def test_a_terminal_counts_frames_of_an_unknown_number(drive: Path) -> None:
    leader, follower = pty.openpty()
    options = ["--every", "0.5", "--gap", "1"]
    command = [
        sys.executable,
        "-m",
        "surefix",
        "run",
        drive / "route.safetensors",
        drive / "drive.bag",
        *options,
    ]
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
    text = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", seen.decode())
    assert process.returncode == 0, text
    assert "╭─ frame 10 ─" in text
    assert re.search(r"0 dropped, 1 gap\b", text)


MISTAKES = {
    "metres without odometry": (
        ["@drive.bag", "--metres", 3],
        2,
        "--metres: expected --odometry too",
    ),
    "odometry without a scale": (
        ["@drive.bag", "--odometry", "/odom"],
        2,
        "--odometry: expected a map with positions, --spacing or --places-per-metre",
    ),
    "a scale without odometry": (
        ["@drive.bag", "--spacing", 2],
        2,
        "--spacing: expected --odometry too",
    ),
    "two scales": (
        ["@drive.bag", "--odometry", "/odom", "--spacing", 2, "--places-per-metre", 0.5],
        2,
        "--spacing: not with --places-per-metre too",
    ),
    "a scale of 0": (
        ["@drive.bag", "--odometry", "/odom", "--places-per-metre", 0],
        2,
        "--places-per-metre: expected a number other than 0, got 0.0",
    ),
    "odometry for images without times": (
        ["@images", "--odometry", "@wheels.csv", "--spacing", 2],
        1,
        "wheels.csv: expected frames with times, as of a video or a bag, or files named by",
    ),
    "no seconds": (["@drive.bag", "--every", 0], 2, "--every: expected a number above 0, got 0"),
    "no number as seconds": (
        ["@drive.bag", "--gap", "nan"],
        2,
        "--gap: expected a number above 0, got nan",
    ),
    "a stride of 0": (["@drive.bag", "--stride", 0], 2, "stride"),
    "a topic of a folder": (["@images", "--topic", "/camera"], 1, "topic: expected a bag"),
    "a topic that is not there": (
        ["@drive.bag", "--topic", "/front"],
        1,
        "/camera (sensor_msgs/msg/Image, 40 messages)",
    ),
    "time in a folder": (["@images", "--every", 1], 1, "every: expected frames with times"),
    "a video to follow": (["@drive.mkv", "--follow"], 1, "follow: expected a folder or a pattern"),
    "idle without follow": (["@images", "--idle", 1], 1, "idle: expected follow too"),
    "a file of another kind": (
        ["@wheels.csv"],
        1,
        "wheels.csv: expected a folder of images, a pattern, or",
    ),
    "no such video": (["nowhere.mp4"], 1, "nowhere.mp4: cannot read the video"),
    "no such bag": (["nowhere.mcap"], 1, "nowhere.mcap: cannot read the bag"),
    "odometry of another clock": (
        ["@drive.bag", "--metres", 3, "--odometry", "@wheels.csv"],
        1,
        "clocks the same?",
    ),
    "a topic of odometry for a video": (
        ["@drive.mkv", "--metres", 3, "--odometry", "/odom"],
        1,
        "a topic of the bag",
    ),
    "the bag as the output": (["@drive.bag", "-o", "@drive.bag"], 2, "is what is read here"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_gets_one_clear_message(name: str, drive: Path) -> None:
    arguments, code, words = MISTAKES[name]
    given = [str(argument).replace("@", f"{drive}/") for argument in arguments]
    before = (drive / "drive.bag").read_bytes()
    done = surefix_("run", drive / "route.safetensors", *given, code=code)
    assert words in re.sub(r"[\s│]+", " ", done.stderr), done.stderr
    assert (drive / "drive.bag").read_bytes() == before


def test_the_help_has_an_example_of_each_kind() -> None:
    text = surefix_("run", "--help").stdout
    assert text.count("Example: surefix run") >= 3
    options = ("follow", "idle", "stride", "every", "metres", "odometry", "topic", "gap", "newest")
    assert all(f"--{option}" in text for option in options)


def test_a_map_of_a_video_or_a_bag_is_that_of_its_images(drive: Path, tmp_path: Path) -> None:
    whole = surefix.Map.from_images(drive / "images", progress=False)
    made = surefix_(
        "map", "build", drive / "drive.mkv", "-o", tmp_path / "video.safetensors"
    ).stdout
    assert made.startswith(f"Made {tmp_path / 'video.safetensors'}: 40 places x 2048 uint8")
    route = surefix.Map.open(tmp_path / "video.safetensors")
    assert np.array_equal(route.descriptors, whole.descriptors)
    assert (route.descriptor, route.positions) == (whole.descriptor, None)
    assert route.names == [str(index) for index in range(PLACES)]

    by_odometry = ["--metres", 4, "--odometry", "/odom", "--topic", "/camera"]
    surefix_("map", "build", drive / "drive.bag", "-o", tmp_path / "bag.safetensors", *by_odometry)
    route = surefix.Map.open(tmp_path / "bag.safetensors")
    assert np.array_equal(route.descriptors, whole.descriptors[::2])
    assert route.positions is not None
    assert route.positions.tolist() == [[2.0 * index, 0, 0] for index in range(0, PLACES, 2)]
    assert route.names == [str(index) for index in range(0, PLACES, 2)]


def test_a_map_of_images_named_by_their_times_gets_positions_of_a_trajectory(
    drive: Path, tmp_path: Path
) -> None:
    (tmp_path / "cam0").mkdir()
    lines = ["#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m]"]
    for index in range(PLACES):
        stamp = 1_700_000_000_000_000_000 + index * 10**8
        (tmp_path / f"cam0/{stamp}.png").symlink_to(drive / f"images/{index}.png")
        lines.append(f"{stamp},{3 * index},{4 * index},0")
    (tmp_path / "data.csv").write_text("\n".join(lines))
    out = tmp_path / "route.safetensors"
    sampled = ["--metres", 10, "--odometry", tmp_path / "data.csv"]
    surefix_("map", "build", tmp_path / "cam0", "-o", out, *sampled)
    route = surefix.Map.open(out)
    assert route.positions is not None
    assert route.positions.tolist() == [[3 * i, 4 * i, 0] for i in range(0, PLACES, 2)]
    assert route.names is not None
    assert route.names[1] == "1700000000200000000.png"


def by_odometry(drive: Path, folder: Path) -> dict[str, list[Any]]:
    """Arguments that all give an advance of a place a frame, and all but the last no gap."""
    positions = np.stack([2.0 * np.arange(PLACES), np.zeros(PLACES)], axis=1)
    images = drive / "images"
    with_positions, bare = folder / "with.safetensors", drive / "route.safetensors"
    summer = Route(places=PLACES, size=(96, 48)).reference()
    surefix.Map.from_images(summer, positions=positions, progress=False).save(with_positions)
    poses = folder / "poses.txt"
    poses.write_text("".join(f"1 0 0 0 0 1 0 0 0 0 1 {2 * i}\n" for i in range(PLACES)))
    bag, video, wheels = drive / "drive.bag", drive / "drive.mkv", drive / "wheels.csv"
    return {
        "the map's positions": [with_positions, bag, "--odometry", "/odom"],
        "--spacing 2": [bare, bag, "--odometry", "/odom", "--spacing", 2],
        "--spacing 3": [bare, video, "--odometry", wheels, "--spacing", 3],
        "--places-per-metre": [bare, images, "--odometry", poses, "--places-per-metre", 0.5],
        "over a gap": [with_positions, bag, "--odometry", "/odom", "--gap", 1],
    }


@pytest.mark.parametrize("motion", ["steady", "free"])
def test_odometry_moves_the_track(motion: Any, drive: Path, tmp_path: Path) -> None:
    route = surefix.Map.open(drive / "route.safetensors")
    images = [surefix.read_image(drive / f"images/{index}.png") for index in range(PLACES)]
    cases = by_odometry(drive, tmp_path)
    for of, arguments in cases.items():
        localizer = surefix.Localizer(route, motion=motion)
        expected = []
        for index, image in enumerate(images):
            if of == "over a gap" and index == 20:
                localizer.gap(0.0)
            expected.append(localizer.push(image, advance=1.0 if index else None))
        done = surefix_("run", *arguments, "--motion", motion, "--format", "json")
        found = [json.loads(line) for line in done.stdout.splitlines()]
        assert [(row["place"], row["ready"]) for row in found] == [
            (fix.place, fix.sequence is not None) for fix in expected
        ]
        assert [row["score"] for row in found] == pytest.approx([fix.score for fix in expected])
        scale = "0.333" if of == "--spacing 3" else "0.5"
        by = "the map's positions" if of == "over a gap" else of
        assert f", {scale} places a metre ({by})\n" in done.stderr
    assert "odometry: " + str(drive / "drive.bag, /odom") in done.stderr


def test_what_odometry_lacks_is_said(drive: Path, tmp_path: Path) -> None:
    (tmp_path / "gps.csv").write_text("time,x,y\n0.5,0,0\n3,9,0\n3.5,9,2\n")
    options = ["--odometry", tmp_path / "gps.csv", "--places-per-metre", -0.5, "--motion", "none"]
    said = surefix_("run", drive / "route.safetensors", drive / "drive.mkv", *options).stderr
    line = said.splitlines()[-1]
    assert line == (
        f"odometry: {tmp_path / 'gps.csv'}, -0.5 places a metre (--places-per-metre), no heading, "
        "so that reversing is not seen, 9 frames before its first or after its last time, "
        "unused with --motion none"
    )
    # Frames by distance need no places, and no word about them.
    route = by_odometry(drive, tmp_path)["the map's positions"][0]
    sampled = ["run", route, drive / "drive.bag", "--metres", 4, "--odometry", "/odom"]
    assert "odometry:" not in surefix_(*sampled, "--motion", "none").stderr
    assert "odometry:" in surefix_(*sampled, "--motion", "steady").stderr


def test_a_long_recording_is_described_piece_by_piece(
    drive: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mapping, "AT_ONCE", 7)
    where = np.arange(80.0).reshape(40, 2)
    route = mapping.sad_map(frames_open(drive / "drive.mkv"), surefix.Sad(), where)
    whole = surefix.Map.from_images(drive / "images", progress=False)
    assert np.array_equal(route.descriptors, whole.descriptors)
    assert route.positions is not None
    assert np.array_equal(route.positions, where)
    assert route.names == [str(index) for index in range(PLACES)]
    for count in (39, 41, 3):
        with pytest.raises(
            surefix.SurefixValueError, match=f"a frame for each of {count} positions, got 40"
        ):
            mapping.sad_map(frames_open(drive / "drive.mkv"), surefix.Sad(), np.zeros((count, 2)))


def test_options_of_recordings_are_for_recordings(drive: Path, tmp_path: Path) -> None:
    out = tmp_path / "route.safetensors"
    refused = surefix_("map", "build", drive / "images", "--every", 2, "-o", out, code=2).stderr
    assert "expected a video or a bag" in re.sub(r"[\s│]+", " ", refused)
    assert not out.exists()


def test_an_error_in_a_frame_names_it(drive: Path, tmp_path: Path) -> None:
    rows_ = np.ones((3, 5), np.float32)
    np.save(tmp_path / "known.npy", np.eye(4, 5, dtype=np.float32))
    rows_[2, 0] = np.nan
    np.save(tmp_path / "queries.npy", rows_)
    surefix_("map", "build", tmp_path / "known.npy", "-o", tmp_path / "known.safetensors")
    done = surefix_("run", tmp_path / "known.safetensors", tmp_path / "queries.npy", code=1)
    assert done.stderr.splitlines()[0].startswith("2 fixes, ")
    assert re.match(r"surefix: 2: .*NaN|surefix: 2: .*finite", done.stderr.splitlines()[-1])
