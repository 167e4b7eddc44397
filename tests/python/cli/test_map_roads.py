"""Breaks and closed roads that ``surefix map build`` and ``append`` find, and those by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

import surefix
from commands import surefix_
from recordings import Bag, write_video
from surefix.simulate import Route

N = 60
UInt8 = npt.NDArray[np.uint8]


@pytest.fixture(scope="module")
def images() -> list[UInt8]:
    return [*Route(places=N, size=(64, 32), seed=3).reference()]


@pytest.fixture(scope="module")
def folder(images: list[UInt8], tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("road") / "images"
    made.mkdir()
    for index, image in enumerate(images):
        Image.fromarray(image).save(made / f"{index:03}.png")
    return made


def straight(step: float = 2) -> npt.NDArray[np.float64]:
    return np.stack([np.arange(N) * step, np.zeros(N)], axis=1)


def ring(places: int) -> npt.NDArray[np.float64]:
    turn = 2 * np.pi * np.arange(N) / places
    return 2 * places / (2 * np.pi) * np.stack([np.cos(turn), np.sin(turn)], axis=1)


def built(out: Path, *arguments: Any) -> tuple[surefix.Map, str]:
    """The map, and the line that says so."""
    said = surefix_("map", "build", *arguments, "-o", out).stdout
    assert said.count("\n") == 1
    return surefix.Map.open(out), said.rstrip()


def test_a_gap_in_a_video_is_a_break(images: list[UInt8], tmp_path: Path) -> None:
    stamps = [index + 120 * (index >= 20) for index in range(N)]
    write_video(tmp_path / "drive.mkv", images, stamps=stamps)
    route, said = built(tmp_path / "map", tmp_path / "drive.mkv")
    assert route.segments.breaks.tolist() == [20]
    assert said.endswith("; 1 break: before place 20 (a gap of 12 s)")
    route, said = built(tmp_path / "map", tmp_path / "drive.mkv", "--stride", 2)
    assert route.segments.breaks.tolist() == [10]
    route, said = built(tmp_path / "map", tmp_path / "drive.mkv", "--no-breaks")
    assert len(route.segments) == 1
    assert "break" not in said
    route, said = built(tmp_path / "map", tmp_path / "drive.mkv", "--break", 30, "--break", "9,40")
    assert route.segments.breaks.tolist() == [9, 20, 30, 40]
    expected = "before place 9, before 20 (a gap of 12 s), before 30, before 40"
    assert said.endswith(f"; 4 breaks: {expected}")


@pytest.mark.parametrize("name", ["{}000000", "{}.5"])
def test_files_named_by_their_times_have_gaps(
    name: str, images: list[UInt8], tmp_path: Path
) -> None:
    for index, image in enumerate(images[:30]):
        second = 1_700_000_000_000 + 200 * index + 9000 * (index >= 10)
        stem = name.format(second) if "0" in name else f"{second / 1000:.1f}"
        Image.fromarray(image).save(tmp_path / f"{stem}.png")
    route, said = built(tmp_path / "map", tmp_path / "*.png")
    assert route.segments.breaks.tolist() == [10]
    assert said.endswith("; 1 break: before place 10 (a gap of 9 s)")


def test_a_jump_of_the_positions_is_a_break(folder: Path, tmp_path: Path) -> None:
    where = straight()
    np.save(tmp_path / "where.npy", where)
    route, said = built(tmp_path / "map", folder, "--positions", tmp_path / "where.npy")
    assert len(route.segments) == 1
    assert "break" not in said
    where[25:, 1] += 340
    np.save(tmp_path / "where.npy", where)
    route, said = built(tmp_path / "map", folder, "--positions", tmp_path / "where.npy")
    assert route.segments.breaks.tolist() == [25]
    assert said.endswith("; 1 break: before place 25 (a jump of 340 m)")


def test_a_bag_breaks_at_a_jump_and_not_at_a_halt(images: list[UInt8], tmp_path: Path) -> None:
    with Bag(tmp_path, "ros1") as bag:
        for index, image in enumerate(images):
            # A halt of a minute, and a jump.
            at = 100 + index / 4 + 60 * (index >= 20)
            east = 2.0 * index + 400 * (index >= 40)
            bag.image("/camera", image, at)
            bag.pose("/odom", "nav_msgs/msg/Odometry", (east, 0, 0), at)
    sampled = "--metres", 2, "--odometry", "/odom"
    route, said = built(tmp_path / "map", tmp_path / "drive.bag", *sampled)
    assert len(route.segments) == 2
    assert "1 break: before place 40 (a jump of 402 m)" in said
    # Without positions, a minute is a gap.
    route, said = built(tmp_path / "map", tmp_path / "drive.bag")
    assert "1 break: before place 20 (a gap of 60 s)" in said


def test_the_way_along_tells_a_halt_from_a_gap(images: list[UInt8], tmp_path: Path) -> None:
    rows = ["time,distance"]
    stamps = [10 * index + 600 * (index >= 20) for index in range(N)]
    rows += [f"{stamp / 10},{2 * index}" for index, stamp in enumerate(stamps)]
    (tmp_path / "way.csv").write_text("\n".join(rows))
    write_video(tmp_path / "drive.mkv", images, stamps=stamps)
    sampled = "--metres", 2, "--odometry", tmp_path / "way.csv"
    route, said = built(tmp_path / "map", tmp_path / "drive.mkv", *sampled)
    assert route.positions is None
    assert len(route.segments) == 1, said


def test_a_tunnel_that_is_left_out_is_a_break(images: list[UInt8], tmp_path: Path) -> None:
    dark = [image * (not 20 <= index < 28) for index, image in enumerate(images)]
    write_video(tmp_path / "drive.mkv", dark)
    route, said = built(tmp_path / "map", tmp_path / "drive.mkv", "--skip-blank", "--break", 40)
    assert route.segments.breaks.tolist() == [20, 32]
    # In the numbers of the map that is written.
    assert "; 2 breaks: before place 20 (8 places left out), before 32; 8 places show" in said
    assert said.count("break") == 1
    # A break among places that are left out is the one that they make.
    route, said = built(tmp_path / "map", tmp_path / "drive.mkv", "--skip-blank", "--break", 24)
    assert route.segments.breaks.tolist() == [20]
    assert "; 1 break: before place 20 (8 places left out);" in said


def test_a_closed_road_with_a_tunnel_left_out_is_not_said_to_be_closed(
    images: list[UInt8], tmp_path: Path
) -> None:
    dark = [image * (not 20 <= index < 28) for index, image in enumerate(images)]
    write_video(tmp_path / "drive.mkv", dark)
    route, said = built(tmp_path / "map", tmp_path / "drive.mkv", "--skip-blank", "--closed")
    assert not any(each.closed for each in route.segments)
    assert "closed: the last" not in said
    links = f"{len(route.segments.links)} links"
    expected = f"1 segment not closed, as places of it are left out: 2 open segments, with {links}"
    assert expected in said
    route, said = built(tmp_path / "map", tmp_path / "drive.mkv", "--closed")
    assert "; closed: the last place is followed by the first" in said


def test_a_ring_is_closed_by_itself(folder: Path, tmp_path: Path) -> None:
    np.save(tmp_path / "ring.npy", ring(N))
    given = folder, "--positions", tmp_path / "ring.npy"
    route, said = built(tmp_path / "map", *given)
    assert [each.closed for each in route.segments] == [True]
    assert said.endswith("; closed: the last place is followed by the first (2.0 m apart)")
    # The second name is the old one.
    for flag in ("--not-closed", "--open"):
        route, said = built(tmp_path / "map", *given, flag)
        assert not route.segments[0].closed
        assert "; closed" not in said
        both = surefix_("map", "build", *given, "--closed", flag, "-o", tmp_path / "no", code=2)
        assert "--closed: expected it or --not-closed, got both" in both.stderr
        assert not (tmp_path / "no").exists()
    assert "--open" not in surefix_("map", "build", "--help").stdout
    route, said = built(tmp_path / "map", folder, "--closed")
    assert route.segments[0].closed
    assert said.endswith("; closed: the last place is followed by the first")
    route, said = built(tmp_path / "map", folder, "--closed", "--break", 20)
    assert said.endswith("; 2 of 2 segments closed: 0, 1")


def test_a_lap_and_a_bit_says_which_cut_closes_it(folder: Path, tmp_path: Path) -> None:
    np.save(tmp_path / "ring.npy", ring(50))
    out = tmp_path / "map"
    route, said = built(out, folder, "--positions", tmp_path / "ring.npy")
    assert not route.segments[0].closed
    lap = f"surefix map cut {out} 0:50"
    assert said.endswith(f"; places 50 to 59 go round a second time; {lap} makes it a closed lap")
    said = surefix_(*lap.split()[1:]).stdout
    assert "closed: the last place is followed by the first" in said
    assert surefix.Map.open(out).segments[0].closed
    assert len(surefix.Map.open(out)) == 50


def test_a_map_that_grows_breaks_at_a_jump(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "map"
    for name, east in (("near", 0), ("far", 400)):
        np.save(tmp_path / "first.npy", straight()[:30])
        np.save(tmp_path / "second.npy", straight()[30:] + np.array([east, 0]))
        built(out, folder / "0[012]?.png", "--positions", tmp_path / "first.npy")
        given = folder / "0[345]?.png", "--positions", tmp_path / "second.npy"
        said = surefix_("map", "append", out, *given).stdout
        assert said.startswith("Added 30 places to ")
        far = name == "far"
        assert ("1 break: before place 30 (a jump of 402 m)" in said) == far
        assert surefix.Map.open(out).segments.breaks.tolist() == [30] * far


def test_a_map_grows_by_a_segment_of_its_own(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "map"
    built(out, folder / "0[012]?.png", "--break", 10)
    surefix_("map", "append", out, folder / "0[345]?.png", "--new-segment", "--break", 50)
    assert surefix.Map.open(out).segments.breaks.tolist() == [10, 30, 50]
    # A closed road has no end to go on from.
    built(out, folder / "0[012]?.png", "--closed")
    surefix_("map", "append", out, folder / "0[345]?.png")
    grown = surefix.Map.open(out).segments
    assert [(each.start, each.closed) for each in grown] == [(0, True), (30, False)]


def test_a_break_that_is_refused_late_leaves_the_map(tmp_path: Path) -> None:
    out, rows = tmp_path / "map", np.eye(10, dtype=np.float32)
    np.save(tmp_path / "rows.npy", rows)
    built(out, tmp_path / "rows.npy")
    before = out.read_bytes()
    append = "map", "append", out, tmp_path / "rows.npy"
    said = surefix_(*append, "--break", 5, code=2, COLUMNS="200").stderr
    assert "--break: expected places from 10 to 19, got 5" in " ".join(said.split())
    assert out.read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map", "rows.npy"]
    surefix_(*append, "--break", 15)
    assert surefix.Map.open(out).segments.breaks.tolist() == [15]


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--break", "0"], "--break: expected a place from 1 on, or several with commas, got '0'"),
        (["--break", "4,x"], "--break: expected a place from 1 on"),
        (["--break", "-3"], "--break: expected a place from 1 on"),
        (["--break", "60"], "--break: expected places from 1 to 59, got 60"),
        (["--closed", "--break", "2"], "--closed: expected a segment of at least 3 places"),
    ],
)
def test_breaks_that_are_none(
    options: list[str], expected: str, folder: Path, tmp_path: Path
) -> None:
    out = tmp_path / "map"
    done = surefix_("map", "build", folder, *options, "-o", out, code=2, COLUMNS="200")
    assert expected in " ".join(done.stderr.split())
    assert not out.exists() or len(surefix.Map.open(out)) == N
    built(out, folder / "0[012]?.png")
    before = out.read_bytes()
    if "--closed" not in options:
        done = surefix_("map", "append", out, folder / "0[345]?.png", *options, code=2)
        assert out.read_bytes() == before


def test_names_that_come_twice_are_said_at_build(images: list[UInt8], tmp_path: Path) -> None:
    for part in ("a", "b"):
        (tmp_path / part).mkdir()
        for index in range(5):
            Image.fromarray(images[index]).save(tmp_path / part / f"{index}.png")
    _, said = built(tmp_path / "map", tmp_path / "*" / "*.png")
    assert said.endswith("; warning: places 5 to 9 have names that come before")
