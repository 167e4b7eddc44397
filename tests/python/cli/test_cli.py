"""The command line, as a user runs it."""

import csv
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
from surefix.simulate import Route

PLACES = 60


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of each drive, named so that the order of counting is not the order of the
    alphabet.
    """
    folder = tmp_path_factory.mktemp("drives")
    route = Route(places=PLACES, size=(96, 48))
    for name, drive in (("summer", route.reference()), ("winter", route.revisit())):
        (folder / name).mkdir()
        for index in range(PLACES):
            Image.fromarray(drive[index]).save(folder / name / f"frame{index}.png")
    (folder / "summer" / "notes.txt").write_text("not an image")
    surefix_("map", "build", folder / "summer", "-o", folder / "route.safetensors")
    return folder


def test_build_says_what_it_made_and_where(drives: Path, tmp_path: Path) -> None:
    out = tmp_path / "again.safetensors"
    done = surefix_("map", "build", drives / "summer" / "*.png", "-o", out)
    assert re.fullmatch(
        rf"Made {re.escape(str(out))}: 60 places x 2048 uint8, 0\.1 MB, in [\d.]+ s\n", done.stdout
    )
    assert out.read_bytes() == (drives / "route.safetensors").read_bytes()
    assert surefix.Map.open(out).names == [f"frame{index}.png" for index in range(PLACES)]


def test_append_says_what_it_added_and_makes_the_map_of_all_images(
    drives: Path, tmp_path: Path
) -> None:
    first, rest, out = tmp_path / "first", tmp_path / "rest", tmp_path / "route.safetensors"
    for index in range(PLACES):
        folder = first if index < 20 else rest
        folder.mkdir(exist_ok=True)
        (folder / f"frame{index}.png").symlink_to(drives / "summer" / f"frame{index}.png")
    surefix_("map", "build", first, "-o", out)
    done = surefix_("map", "append", out, rest)
    said = rf"Added 40 places to {re.escape(str(out))}: now 60 places x 2048 uint8, 0\.1 MB, in [\d.]+ s\n"
    assert re.fullmatch(said, done.stdout)
    assert out.read_bytes() == (drives / "route.safetensors").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "first",
        "rest",
        "route.safetensors",
    ]


def test_ready_descriptors_are_appended_with_their_positions(tmp_path: Path) -> None:
    rows = np.random.default_rng(0).normal(size=(9, 5)).astype(np.float32)
    where = np.arange(18.0).reshape(9, 2)
    for name, part in (("whole", slice(0, 9)), ("first", slice(0, 4)), ("rest", slice(4, 9))):
        np.save(tmp_path / f"{name}.npy", rows[part])
        np.save(tmp_path / f"{name}_at.npy", where[part])
    for name in ("whole", "first"):
        positions = tmp_path / f"{name}_at.npy"
        surefix_(
            "map",
            "build",
            tmp_path / f"{name}.npy",
            "-o",
            tmp_path / name,
            "--positions",
            positions,
        )
    surefix_(
        "map",
        "append",
        tmp_path / "first",
        tmp_path / "rest.npy",
        "--positions",
        tmp_path / "rest_at.npy",
    )
    assert (tmp_path / "first").read_bytes() == (tmp_path / "whole").read_bytes()
    refused = surefix_("map", "append", tmp_path / "first", tmp_path / "rest.npy", code=1).stderr
    assert (
        f"{tmp_path / 'first'}: cannot append: expected positions of 2 coordinates, got no positions"
        in refused
    )


def test_info(drives: Path) -> None:
    file = drives / "route.safetensors"
    facts = json.loads(surefix_("map", "info", file, "--json").stdout)
    assert facts["places"] == PLACES
    assert facts["names"] == ["frame0.png", "frame59.png"]
    table = surefix_("map", "info", file).stdout
    assert all(
        word in table
        for word in ("60", "2048", "uint8", "manhattan", "Sad(size=(64, 32)", "frame59.png")
    )


def test_run_streams_what_the_batch_gives(drives: Path, tmp_path: Path) -> None:
    file, queries = drives / "route.safetensors", drives / "winter"
    options = ["-L", 4, "-w", 0.9, "--tolerance", 2, "--speeds", "0.5,1,1.5", "--floor", 0.1]
    options += ["--motion", "none"]
    done = surefix_("run", file, queries, *options)
    rows = list(csv.DictReader(done.stdout.splitlines()))
    run = surefix.match(
        surefix.Map.open(file),
        queries,
        sequence_length=4,
        weight=0.9,
        tolerance=2,
        speeds=[0.5, 1, 1.5],
        floor=0.1,
    )
    assert [int(row["place"]) for row in rows] == run.place.tolist()
    assert [np.float32(row["score"]) for row in rows] == run.score.tolist()
    assert [row["anchors"] for row in rows[:3]] == ["", "", ""]
    assert [int(row["anchors"]) for row in rows[3:]] == run.anchors[3:].tolist()
    assert [row["query"] for row in rows] == [f"frame{index}.png" for index in range(PLACES)]
    trusted = int(run.trusted.sum())
    assert done.stderr.startswith(f"60 fixes, {trusted} trusted ({trusted / 60:.0%}), latency p50 ")

    lines = surefix_("run", file, queries, *options, "--format", "json").stdout.splitlines()
    assert [json.loads(line)["place"] for line in lines] == run.place.tolist()

    out = tmp_path / "fixes.jsonl"
    done = surefix_("run", file, queries, "-o", out, *options)
    assert done.stdout == ""
    assert done.stderr.rstrip().endswith(f"in {out}")
    strip = [json.loads(line) | {"latency_us": 0} for line in out.read_text().splitlines()]
    assert strip == [json.loads(line) | {"latency_us": 0} for line in lines]


def test_arrays_of_images_and_of_descriptors(drives: Path, tmp_path: Path) -> None:
    images, descriptors = tmp_path / "images.npy", tmp_path / "descriptors.npy"
    frames = np.stack(
        [surefix.read_image(drives / "summer" / f"frame{i}.png") for i in range(PLACES)]
    )
    np.save(images, frames)
    np.save(descriptors, np.stack([surefix.Sad(dtype="f32").describe(frame) for frame in frames]))
    where = tmp_path / "where.csv"
    where.write_text("".join(f"{3 * index},0\n" for index in range(PLACES)))

    surefix_(
        "map", "build", images, "-o", tmp_path / "a.safetensors", "--size", "32x16", "--patch", 4
    )
    assert surefix.Map.open(tmp_path / "a.safetensors").dim == 512
    surefix_(
        "map",
        "build",
        descriptors,
        "-o",
        tmp_path / "b.safetensors",
        "--metric",
        "euclidean",
        "--positions",
        where,
    )
    route = surefix.Map.open(tmp_path / "b.safetensors")
    assert (route.metric, route.descriptor, route.dtype) == ("euclidean", None, np.float32)
    assert route.positions is not None
    assert route.positions[59].tolist() == [177, 0]
    done = surefix_("run", tmp_path / "b.safetensors", descriptors)
    assert [int(row["place"]) for row in csv.DictReader(done.stdout.splitlines())] == list(
        range(PLACES)
    )


@pytest.mark.slow
def test_a_terminal_gets_a_live_table_and_a_summary(drives: Path) -> None:
    leader, follower = pty.openpty()
    command = [
        sys.executable,
        "-m",
        "surefix",
        "run",
        str(drives / "route.safetensors"),
        str(drives / "winter"),
    ]
    environment = os.environ | {"TERM": "xterm-256color", "COLUMNS": "110", "LINES": "40"}
    process = subprocess.Popen(
        command, stdout=follower, stderr=follower, stdin=follower, env=environment
    )
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
    assert process.wait(timeout=60) == 0
    text = seen.decode()
    assert "not kept: add -o fixes.csv" in text
    assert "\x1b[" in text
    assert "frame59.png" in text
    assert "frame 60 of 60" in text
    assert "60 fixes" in text


MISTAKES = {
    "no such map": (["run", "nowhere.safetensors", "."], 1, "nowhere.safetensors"),
    "no such images": (["map", "build", "nowhere"], 1, "nowhere"),
    "a folder without images": (["map", "build", "."], 1, "found none"),
    "weight out of range": (
        ["run", "@route.safetensors", "@winter", "-w", "1.5"],
        2,
        "from 0 to 1, got 1.5",
    ),
    "L of 0": (
        ["run", "@route.safetensors", "@winter", "-L", "0"],
        2,
        "from 1 to 60 (the number of places), got 0",
    ),
    "an unknown option": (["run", "--fast"], 2, "--fast"),
    "an unknown command": (["fly"], 2, "fly"),
    "a size that is none": (["map", "build", "@summer", "--size", "64"], 2, "WIDTHxHEIGHT"),
    "a patch that does not divide": (["map", "build", "@summer", "--patch", "7"], 2, "patch"),
    "L above the places": (["run", "@route.safetensors", "@winter", "-L", "61"], 2, "from 1 to 60"),
    "the global floor": (
        ["run", "@route.safetensors", "@winter", "--floor", "global"],
        2,
        "global",
    ),
    "speeds that are none": (
        ["run", "@route.safetensors", "@winter", "--speeds", "fast"],
        2,
        "fast",
    ),
    "an image for a map": (["map", "info", "@winter/frame3.png"], 1, "frame3.png"),
    "a folder that cannot be written": (
        ["map", "build", "@summer", "-o", "/nowhere/x"],
        1,
        "/nowhere/x",
    ),
    "a text as an array": (["map", "build", "@text.npy"], 1, "text.npy"),
    "an array of one dimension": (["map", "build", "@flat.npy"], 1, "(5,)"),
    "a metric for SAD": (
        ["map", "build", "@summer", "--metric", "cosine"],
        2,
        "got images for SAD, which is manhattan",
    ),
    "a size for descriptors": (
        ["map", "build", "@wide.npy", "--size", "abc"],
        2,
        "--size, --patch, --dtype: expected",
    ),
    "a patch for descriptors": (
        ["map", "build", "@wide.npy", "--patch", "4"],
        2,
        "got the ready descriptors",
    ),
    "appending to nothing": (
        ["map", "append", "nowhere.safetensors", "@summer"],
        1,
        "nowhere.safetensors",
    ),
    "appending to an image": (
        ["map", "append", "@winter/frame3.png", "@summer"],
        1,
        "frame3.png: not a usable",
    ),
    "appending nothing": (["map", "append", "@route.safetensors", "."], 1, "found none"),
    "appending other descriptors": (
        ["map", "append", "@route.safetensors", "@wide.npy"],
        1,
        "route.safetensors: cannot append: expected SAD descriptors of 64 x 32 x uint8, patch 8, got ready descriptors",
    ),
    "appending a map to itself": (
        ["map", "append", "@wide.npy", "@wide.npy"],
        1,
        "wide.npy: not a usable",
    ),
    "positions of words": (
        ["map", "build", "@summer", "--positions", "@summer/notes.txt"],
        1,
        "notes.txt",
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_gets_one_clear_message(
    name: str, drives: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (drives / "text.npy").write_text("hello")
    np.save(drives / "flat.npy", np.zeros(5))
    np.save(drives / "wide.npy", np.ones((3, 7), np.float32))
    arguments, code, words = MISTAKES[name]
    done = surefix_(*(a.replace("@", f"{drives}/") for a in arguments), code=code)
    assert words in re.sub(r"[\s│]+", " ", done.stderr), done.stderr
    if code == 1:
        assert done.stderr.startswith("surefix: ")
        assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_fixes_before_a_bad_image_are_kept(drives: Path, tmp_path: Path) -> None:
    for index in range(10):
        Image.new("L", (96, 48), index).save(tmp_path / f"{index}.png")
    (tmp_path / "7.png").write_bytes(b"\x89PNG not really")
    out, kept = tmp_path / "fixes.csv", tmp_path / "fixes.part.csv"
    out.write_text("old")
    done = surefix_("run", drives / "route.safetensors", tmp_path, "-o", out, "--strict", code=1)
    assert "7.png" in done.stderr
    assert done.stderr.startswith("7 fixes, ")
    assert f"stopped: the rows so far are in {kept}, not in {out}\n" in done.stderr
    assert len(kept.read_text().splitlines()) == 1 + 7
    assert out.read_text() == "old"


def test_queries_that_cannot_be_used_are_not_called_none(drives: Path, tmp_path: Path) -> None:
    (tmp_path / "corrupt").mkdir()
    for name in ("0.png", "1.png"):
        (tmp_path / "corrupt" / name).write_bytes(b"not an image")
    np.save(tmp_path / "narrow.npy", np.zeros((3, 7), np.float32))
    for queries in ("corrupt", "narrow.npy"):
        done = surefix_("run", drives / "route.safetensors", tmp_path / queries, code=1)
        assert done.stderr.startswith("0 fixes: it stopped before the first\n")


@pytest.mark.slow
def test_a_reader_that_has_seen_enough_is_no_error(drives: Path) -> None:
    run = (
        f"'{sys.executable}' -m surefix run {drives}/route.safetensors {drives}/winter | head -n 1"
    )
    done = subprocess.run(["bash", "-c", run], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("frame,query,place")
    assert "Error" not in done.stderr


def test_the_input_is_never_the_output(drives: Path, tmp_path: Path) -> None:
    queries = tmp_path / "queries.npy"
    np.save(queries, np.zeros((70, 48, 96), np.uint8))
    route = tmp_path / "route.safetensors"
    route.write_bytes((drives / "route.safetensors").read_bytes())
    before = {path: path.read_bytes() for path in (queries, route)}
    surefix_("run", route, queries, "-o", queries, code=2)
    surefix_("run", route, queries, "-o", route, code=2)
    surefix_("run", route, drives / "winter", "-o", drives / "winter" / "frame3.png", code=2)
    surefix_("map", "build", queries, "-o", queries, code=2)
    assert before == {path: path.read_bytes() for path in (queries, route)}


@pytest.mark.slow
@pytest.mark.parametrize("streams", [">&-", "> /dev/full", "2>&-", ">&- 2>&-", "-o /dev/full"])
def test_streams_that_refuse_are_no_traceback(drives: Path, streams: str) -> None:
    run = f"'{sys.executable}' -m surefix run {drives}/route.safetensors {drives}/winter {streams}"
    done = subprocess.run(["bash", "-c", run], capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr
    assert done.returncode == (1 if "full" in streams else 0), done.stderr
    assert ("No space left" in done.stderr) == ("full" in streams)


def test_names_are_text_not_markup(drives: Path, tmp_path: Path) -> None:
    for index in range(3):
        Image.new("L", (20, 10), index).save(tmp_path / f"[bold]é{index}.png")
    surefix_("map", "build", tmp_path, "-o", tmp_path / "route.safetensors")
    assert (
        "[bold]é0.png to [bold]é2.png"
        in surefix_("map", "info", tmp_path / "route.safetensors").stdout
    )
    ascii_only = os.environ | {"PYTHONIOENCODING": "ascii"}
    command = [sys.executable, "-m", "surefix", "map", "info", str(tmp_path / "route.safetensors")]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=ascii_only)
    assert "\\xe90.png" in done.stdout


def test_an_archive_is_not_an_array(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", a=np.zeros(3))
    (tmp_path / "a.npz").rename(tmp_path / "a.npy")
    assert "archive" in surefix_("map", "build", tmp_path / "a.npy", code=1).stderr


def test_every_command_has_help_with_an_example() -> None:
    for command in (
        [],
        ["map"],
        ["map", "build"],
        ["map", "append"],
        ["map", "info"],
        ["run"],
        ["demo"],
    ):
        text = surefix_(*command, "--help").stdout
        assert surefix_(*command, "-h").stdout == text
        assert "Usage:" in text
        if len(command) == 2 or command in (["run"], ["demo"]):
            assert "Example: surefix" in text
    assert surefix_("--version").stdout == f"surefix {surefix.__version__}\n"
