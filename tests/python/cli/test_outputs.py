"""Commands write over nothing that they read, and mix no degrees with metres."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import surefix
from commands import surefix_
from recordings import write_video
from surefix._terminal import fitted
from surefix.simulate import Route

N = 60
READ = "is what is read here; name another file"


@pytest.fixture(scope="module")
def road(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two drives of a road and one of another, positions, odometry, and maps of degrees and of
    metres.
    """
    folder = tmp_path_factory.mktemp("road")
    route, other = Route(places=N, size=(64, 32), seed=3), Route(places=N, size=(64, 32), seed=9)
    drives = {"monday": route.reference(), "tuesday": route.revisit(), "other": other.revisit()}
    for name, drive in drives.items():
        (folder / name).mkdir()
        for index, image in enumerate(drive):
            Image.fromarray(image).save(folder / name / f"{index:03}.png")
    np.savetxt(
        folder / "degrees.csv",
        np.stack([51.76 + np.arange(N) * 2e-5, np.full(N, -1.26)], axis=1),
        fmt="%.7f",
        delimiter=",",
        header="latitude,longitude",
        comments="",
    )
    metres = np.stack([np.arange(N) * 2.0, np.zeros(N)], axis=1)
    how: dict[str, Any] = {"delimiter": ",", "comments": "", "fmt": "%.3f"}
    np.savetxt(folder / "metres.csv", metres, header="x,y", **how)
    np.savetxt(folder / "odometry.csv", np.c_[np.arange(N) / 10, metres], header="time,x,y", **how)
    write_video(folder / "drive.mkv", [*route.revisit()])
    for kind in ("degrees", "metres"):
        given = "--positions", folder / f"{kind}.csv", "-o", folder / f"{kind}.map"
        surefix_("map", "build", folder / "monday", *given)
    return folder


def refused(*arguments: Any, code: int = 2) -> str:
    """The words of a refusal, as one line."""
    done = surefix_(*arguments, code=code, COLUMNS="400")
    return " ".join(done.stderr.replace("│", " ").split())


def test_nothing_that_is_read_is_overwritten(road: Path, tmp_path: Path) -> None:
    video, way, known = road / "drive.mkv", road / "odometry.csv", road / "metres.map"
    np.save(tmp_path / "where.npy", np.stack([np.arange(N) * 2.0, np.zeros(N)], axis=1))
    sampled = "--metres", 2, "--odometry", way
    read = video, way, road / "metres.csv", tmp_path / "where.npy", road / "monday" / "000.png"
    before = [file.read_bytes() for file in read]
    for arguments in (
        ("map", "traverse", known, video, "-o", video),
        ("map", "traverse", known, road / "monday", "-o", road / "monday" / "000.png"),
        ("map", "build", road / "monday", "--positions", road / "metres.csv", "-o", read[2]),
        ("map", "build", road / "monday", "--positions", tmp_path / "where.npy", "-o", read[3]),
        ("map", "build", video, *sampled, "-o", way),
        ("loops", video, *sampled, "-o", way),
        ("run", known, video, *sampled, "-o", way),
        ("align", known, video, "--odometry", way, "-o", way),
    ):
        assert READ in refused(*arguments), arguments
    assert [file.read_bytes() for file in read] == before


def test_a_geojson_overwrites_no_other_file(road: Path, tmp_path: Path) -> None:
    (tmp_path / "notes.csv").write_text("mine")
    given = "map", "info", road / "degrees.map", "--geojson"
    expected = "--geojson: expected a new file, or one that ends in .geojson or .json, got"
    assert expected in refused(*given, tmp_path / "notes.csv")
    assert (tmp_path / "notes.csv").read_text() == "mine"
    for name in ("route.geojson", "route.json"):
        for _ in range(2):
            surefix_(*given, tmp_path / name)
        assert "LineString" in (tmp_path / name).read_text()
    surefix_(*given, tmp_path / "route")


def test_metres_do_not_extend_a_map_of_degrees(road: Path, tmp_path: Path) -> None:
    for kind in ("degrees", "metres"):
        out = tmp_path / f"{kind}.map"
        out.write_bytes((road / f"{kind}.map").read_bytes())
        given = "map", "append", out, road / "tuesday", "--positions", road / "metres.csv"
        if kind == "metres":
            surefix_(*given)
        else:
            said = refused(*given, code=1)
            assert "metres.csv: expected latitude,longitude, as the map's positions, got" in said
            given = "map", "append", out, road / "drive.mkv", "--metres", 2
            said = refused(*given, "--odometry", road / "odometry.csv", code=1)
            assert "odometry.csv: expected latitude,longitude, as the map's positions" in said
        assert len(surefix.Map.open(out)) == N * (1 + (kind == "metres"))


def test_queries_in_metres_do_not_fit_a_map_of_degrees(road: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    where = "--query-positions", road / "metres.csv", "--tolerance", 4
    given = road / "degrees.map", road / "tuesday", *where
    for command, out in (("eval", "report"), ("tune", "route.toml")):
        said = refused(command, *given, "-o", tmp_path / out, code=1)
        expected = (
            "metres.csv: expected latitude,longitude, as the positions of the map, got metres"
        )
        assert expected in said
    given = road / "metres.map", road / "tuesday", *where
    surefix_("eval", *given, "-o", tmp_path / "report", "--method", "single")


def test_a_drive_of_another_road_is_not_added_to_the_map(road: Path, tmp_path: Path) -> None:
    known, out, mixed = road / "metres.map", tmp_path / "more.map", tmp_path / "mixed"
    before = known.read_bytes()
    # A third of it is of the road.
    mixed.mkdir()
    for index in range(N):
        source = road / ("tuesday" if index < 20 else "other") / f"{index:03}.png"
        (mixed / source.name).write_bytes(source.read_bytes())
    said = refused("map", "traverse", known, mixed)
    assert "--out: expected another file to write, as" in said
    assert f"{mixed} may be a drive of another road than {known}: " in said
    assert f" of {N} queries are sure; got none" in said
    assert known.read_bytes() == before
    done = surefix_("map", "traverse", known, mixed, "-o", out)
    assert done.stderr.startswith(f"Warning: {mixed} may be a drive of another road than {known}")
    assert len(surefix.Map.open(out).traverses) == 2
    done = surefix_("map", "traverse", known, road / "tuesday", "-o", out)
    assert "Warning" not in done.stderr


def test_a_map_is_no_drive(road: Path, tmp_path: Path) -> None:
    known, video = road / "metres.map", road / "drive.mkv"
    copy = tmp_path / "copy.safetensors"
    copy.write_bytes(known.read_bytes())
    for arguments in (
        ("map", "append", known, copy),
        ("map", "traverse", known, copy),
        ("map", "build", copy, "-o", tmp_path / "x"),
        ("loops", copy),
    ):
        said = refused(*arguments)
        assert f"got {copy}, which is a map: use surefix map join" in said
    said = refused("map", "build", video, "--odometry", road / "odometry.csv", "-o", copy)
    assert "--odometry: expected --metres too, got none" in said
    said = refused("run", known, video, "-o", tmp_path / "f.foo")
    assert "--out: expected a name that ends in .csv, .json" in said


def test_what_does_not_fit_is_named(road: Path, tmp_path: Path) -> None:
    known = road / "metres.map"
    surefix_("map", "build", road / "tuesday", "--patch", 4, "-o", tmp_path / "other.map")
    surefix_("map", "build", road / "tuesday", "-o", tmp_path / "plain.map")
    out = tmp_path / "both.map"
    said = refused("map", "join", known, tmp_path / "plain.map", "-o", out, code=1)
    assert f"{tmp_path / 'plain.map'}: cannot join to {known}: expected" in said
    half = tmp_path / "half.csv"
    np.savetxt(half, np.zeros((30, 2)), delimiter=",", header="x,y", comments="")
    for place in (road / "tuesday", road / "drive.mkv"):
        said = refused("map", "build", place, "--positions", half, "-o", out, code=1)
        assert "half.csv" in said
        assert "30" in said
        assert "60" in said
    assert "ascending places, got '40,9'" in refused(
        "map", "build", road / "tuesday", "--break", "40,9"
    )


def test_a_join_says_that_it_leaves_thumbnails_out(road: Path, tmp_path: Path) -> None:
    small, plain = tmp_path / "small.map", tmp_path / "plain.map"
    surefix_("map", "build", road / "monday", "--thumbnails", "-o", small)
    surefix_("map", "build", road / "tuesday", "-o", plain)
    done = surefix_("map", "join", small, plain, "-o", tmp_path / "both.map")
    assert "; without thumbnails, as 1 of 2 maps have them" in done.stdout
    done = surefix_("map", "join", small, small, "-o", tmp_path / "both.map")
    assert "without thumbnails" not in done.stdout


def test_traverses_are_labelled_and_not_appended_to(road: Path, tmp_path: Path) -> None:
    known, out = road / "metres.map", tmp_path / "both.map"
    for drive, options, label in (
        (road / "tuesday" / "*.png", (), "tuesday"),
        (road / "drive.mkv", (), "drive.mkv"),
        (road / "tuesday", ("--label", "rain"), "rain"),
    ):
        surefix_("map", "traverse", known, drive, *options, "-o", out)
        assert surefix.Map.open(out).traverses[1].label == label
    said = refused("map", "append", out, road / "tuesday")
    assert "expected a map of one traverse" in said
    assert "surefix map join" in said
    assert "--remove: expected a traverse" in refused("map", "traverse", out, "--remove", 0)


def test_an_appended_ring_says_that_a_segment_begins(road: Path, tmp_path: Path) -> None:
    out = tmp_path / "ring.map"
    surefix_("map", "build", road / "monday", "--closed", "-o", out)
    done = surefix_("map", "append", out, road / "tuesday")
    assert "the last segment is closed, so that the new places begin another" in done.stdout
    done = surefix_("map", "append", out, road / "tuesday")
    assert "the last segment is closed" not in done.stdout


def test_loops_without_edges_say_how_sure_they_were(road: Path) -> None:
    images = [*Route(places=N, size=(64, 32), seed=3).reference()]
    np.save(road / "twice.npy", np.stack(images + images))
    done = surefix_("loops", road / "twice.npy", "--exclude", 10, "--lasting", 60)
    assert "120 frames, 0 edges" in done.stderr
    assert "the surest frame is " in done.stderr
    assert "(an edge needs --confidence 0.9, --lasting 60)" in done.stderr


def test_sure_places_that_go_back_are_doubted() -> None:
    from surefix.cli.edit import _doubt

    sure = np.ones(40, bool)
    onward = np.arange(40)
    assert _doubt(onward, sure, None) == ""
    assert _doubt(np.minimum(5 * onward, 100), sure, None) == ""
    assert _doubt(onward[::-1], sure, np.full(40, -1.0)) == ""
    assert _doubt(10 * onward, sure, np.full(40, 9.0)) == ""
    said = _doubt(onward[::-1], sure, None)
    assert said == "39 of 39 steps between sure queries go back or jump"
    assert "go back or jump" in _doubt(10 * onward, sure, None)
    assert _doubt(onward, onward < 15, None) == "15 of 40 queries are sure"


def test_a_sentence_is_broken_between_words_on_a_terminal_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setenv("COLUMNS", "24")
    said = "usual pace 0.98 places, in a/long-name/of/a-file-that-stays-whole.csv"
    assert fitted(said, io.StringIO()) == [said]
    assert fitted(said, Terminal()) == [
        "usual pace 0.98 places,",
        "in",
        "a/long-name/of/a-file-that-stays-whole.csv",
    ]
