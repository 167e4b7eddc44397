"""ROUTE as images: a map in memory, for every command that takes a map and a drive."""

import csv
import re
import shutil
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import commands
import surefix
from recordings import Bag, write_video
from surefix.cli.networks import ModelOptions
from surefix.cli.route import open_route
from surefix.simulate import Route

surefix_ = partial(commands.surefix_, COLUMNS="400")
PLACES = 40
SAID = "monday: a map of 40 places, in memory; --save-map FILE keeps it"


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two drives as folders, videos, bags and an array."""
    folder = tmp_path_factory.mktemp("drives")
    route = Route(places=PLACES, size=(64, 32))
    for name, drive in (("monday", route.reference()), ("tuesday", route.revisit())):
        images = list(drive)
        (folder / name).mkdir()
        for index, image in enumerate(images):
            Image.fromarray(image).save(folder / name / f"{index:03}.png")
        write_video(folder / f"{name}.mkv", images)
        np.save(folder / f"{name}.npy", np.stack(images))
        (folder / f"{name}_bag").mkdir()
        with Bag(folder / f"{name}_bag", "ros1") as bag:
            for index, image in enumerate(images):
                bag.image("/front", image, index / 10)
                bag.image("/back", image[::-1].copy(), index / 10)
                bag.pose("/odom", "nav_msgs/msg/Odometry", (0.5 * index, 0, 0), index / 10)
    return folder


@pytest.fixture(autouse=True)
def _here(drives: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a folder of its own, in which the drives lie."""
    for each in drives.iterdir():
        (tmp_path / each.name).symlink_to(each)
    monkeypatch.chdir(tmp_path)


def rows(text: str) -> list[dict[str, str]]:
    """The fixes, without their latency."""
    found = list(csv.DictReader(text.splitlines()))
    return [{key: value for key, value in row.items() if key != "latency_us"} for row in found]


def test_a_folder_is_the_map_that_build_makes_of_it() -> None:
    done = surefix_("run", "monday", "tuesday")
    assert done.stderr.startswith(f"{SAID}\n40 fixes, ")
    surefix_("map", "build", "monday", "-o", "built.safetensors")
    assert rows(surefix_("run", "built.safetensors", "tuesday").stdout) == rows(done.stdout)
    kept = surefix_("run", "monday/", "tuesday", "--save-map", "kept.safetensors")
    assert kept.stderr.startswith("monday: a map of 40 places, kept in kept.safetensors\n")
    assert Path("kept.safetensors").read_bytes() == Path("built.safetensors").read_bytes()


@pytest.mark.parametrize(
    "route", ["monday/*.png", "monday.mkv", "monday.npy", "monday_bag/drive.bag"]
)
def test_all_kinds_of_images_are_a_route(route: str) -> None:
    topic = ("--topic", "/front") if "bag" in route else ()
    queries = "tuesday_bag/drive.bag" if topic else "tuesday"
    done = surefix_("run", route, queries, *topic)
    assert f"{route}: a map of 40 places, in memory" in done.stderr
    assert "bad frame" not in done.stderr
    found = rows(done.stdout)
    first = rows(surefix_("run", "monday", "tuesday").stdout)
    assert [row["place"] for row in found] == [row["place"] for row in first]


def test_the_route_is_sampled_as_the_queries_are() -> None:
    third = surefix_("run", "monday.mkv", "tuesday.mkv", "--every", 0.3)
    assert "a map of 14 places" in third.stderr
    assert len(rows(third.stdout)) == 14
    for route in ("monday", "monday.npy"):
        half = surefix_("run", route, "tuesday", "--stride", 2, "--save-map", "half.safetensors")
        assert "a map of 20 places" in half.stderr
        assert "bad frame" not in half.stderr
        names = surefix.Map.open("half.safetensors").names
        assert names is not None
        assert [int(name.split(".")[0]) for name in names] == list(range(0, PLACES, 2))
    # Odometry in a file is that of the queries: of another drive it says nothing.
    Path("o.csv").write_text("time,distance\n0,0\n4,4\n")
    options = ("--metres", 1, "--odometry", "o.csv")
    said = surefix_("run", "monday.mkv", "tuesday.mkv", *options, code=2).stderr
    assert "--metres: expected a map as ROUTE" in said
    assert "surefix map build monday.mkv --metres 1 --odometry FILE" in said


def test_two_bags_are_sampled_by_their_own_odometry() -> None:
    options = ("--topic", "/front", "--metres", 1, "--odometry", "/odom")
    bags = ("monday_bag/drive.bag", "tuesday_bag/drive.bag")
    done = surefix_("run", *bags, *options, "--save-map", "m.safetensors")
    assert "a map of 20 places, kept in m.safetensors" in done.stderr
    assert len(rows(done.stdout)) == 20
    where = surefix.Map.open("m.safetensors").positions
    assert where is not None
    np.testing.assert_allclose(np.diff(where[:, 0]), 1)


def test_the_other_commands_take_it_too() -> None:
    for command in (
        ("align", "monday", "tuesday", "-o", "truth.csv"),
        ("audit", "monday", "tuesday", "--motion", "steady"),
        ("tune", "monday", "tuesday", "--truth", "identity", "-o", "route.toml"),
    ):
        assert SAID in surefix_(*command).stderr
    with Path("truth.csv").open(newline="") as file:
        placed = [int(row["reference"]) for row in csv.DictReader(file)]
    assert sum(abs(place - query) <= 1 for query, place in enumerate(placed)) >= 38
    assert Path("route.toml").exists()
    # A .npy of numbers is distances there, one of images is a route.
    D = np.load("monday.npy").reshape(PLACES, -1).astype(np.float32)
    D = abs(D[:, None] - np.load("tuesday.npy").reshape(PLACES, -1)[None]).mean(axis=2)
    np.save("D.npy", D)
    surefix_("align", "D.npy", "-o", "matrix.csv")
    surefix_("align", "monday.npy", "tuesday.npy", "-o", "arrays.csv")
    said = surefix_("run", "D.npy", "tuesday", code=2).stderr
    assert "got the array D.npy; if it holds descriptors, make a map of them: surefix map" in said
    assert "if it holds distances, surefix align, audit, tune and eval take it" in said


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The images of the places that reports were given."""
    given: list[Any] = []

    def write_report(study: object, folder: Path, *_: object, **how: Any) -> Path:
        given.append(how["references"])
        return folder / "report.html"

    monkeypatch.setattr("surefix.report.eval.write_report", write_report)
    return given


@pytest.mark.parametrize("kind", ["", ".npy", ".mkv"])
def test_a_report_of_two_drives_has_the_pictures_of_both(kind: str, shown: list[Any]) -> None:
    options = ("--truth", "identity", "--method", "single")
    done = surefix_("eval", f"monday{kind}", f"tuesday{kind}", *options)
    assert f"monday{kind}: a map of 40 places, in memory" in done.stderr
    (pictures,) = shown
    expected = np.load("monday.npy")[17]
    if kind == ".mkv":
        # The map's thumbnails, which are grey.
        assert abs(pictures[17].mean() - expected.mean()) < 5
    else:
        np.testing.assert_array_equal(pictures[17], expected)


def test_each_place_has_the_picture_that_it_was_made_of() -> None:
    Path("photos").mkdir()
    for index in range(PLACES):
        shutil.copy(f"monday/{index:03}.png", "photos")
    Path("photos/003.png").write_bytes(b"no image")
    made = open_route("photos", ModelOptions(), strict=False, stride=2)
    assert made.pictures is not None
    assert made.map.names == made.pictures.names
    np.testing.assert_array_equal(made.pictures[2], np.asarray(Image.open("photos/004.png")))
    made = open_route("photos", ModelOptions(), strict=False)
    assert made.map.names is not None
    assert made.pictures is not None
    assert made.map.names == made.pictures.names
    assert (len(made.map), "003.png" in made.map.names) == (PLACES - 1, False)
    # Of a recording the map has thumbnails.
    made = open_route("monday.mkv", ModelOptions())
    assert made.pictures is None
    assert made.map.thumbnail(5) is not None


def test_a_map_in_memory_is_checked_as_build_does() -> None:
    Path("photos").mkdir()
    for index, image in enumerate(np.load("monday.npy")):
        # By their names, the photos are a second apart, but for a break.
        time = 100.0 + index + (500 if index > 20 else 0)
        Image.fromarray(0 * image if index == 7 else image).save(f"photos/{time:.1f}.png")
    said = surefix_("run", "photos", "tuesday").stderr.splitlines()[0]
    surefix_("map", "build", "photos", "-o", "m.safetensors")
    built = surefix_("map", "build", "photos", "-o", "m.safetensors").stdout
    notes = built.split(" s; ", 1)[1].strip()
    assert re.search(r"break.*21", notes)
    assert "1 place shows nothing: 7" in notes
    assert said.endswith(f"--save-map FILE keeps it; {notes}")
    Image.new("RGB", (20, 10)).save("photos/900.0.png")
    said = surefix_("run", "photos", "tuesday", code=1).stderr
    assert said.startswith("surefix: a map of photos, in memory: ")
    assert "surefix map build photos has more options" in said


MISTAKES: dict[str, tuple[tuple[object, ...], int, str]] = {
    "a map that is no images": (
        ("run", "built.safetensors", "tuesday", "--save-map", "x"),
        2,
        "--save-map: expected images as ROUTE, of which a map is made, got the map built",
    ),
    "over an image": (
        ("run", "monday", "tuesday", "--save-map", "monday/003.png"),
        2,
        "--save-map: monday/003.png is what is read here; name another file",
    ),
    "over a query": (
        ("audit", "monday", "tuesday.mkv", "--save-map", "tuesday.mkv"),
        2,
        "--save-map: tuesday.mkv is what is read here",
    ),
    "into no folder": (
        ("run", "monday", "tuesday", "--save-map", "no/m.safetensors"),
        1,
        "no/m.safetensors: cannot write the map: there is no folder",
    ),
    "with distances": (
        ("align", "D.npy", "--save-map", "m.safetensors"),
        2,
        "--model, --save-map: expected a map or images, got the distances D.npy",
    ),
    "fixes over it": (
        ("run", "monday", "tuesday", "--save-map", "m.csv", "-o", "m.csv"),
        2,
        "--save-map: m.csv is that of --out",
    ),
    "an alignment over it": (
        ("align", "monday", "tuesday", "-o", "a.csv", "--save-map", "./a.csv"),
        2,
        "--save-map: a.csv is that of --out",
    ),
    "settings over it": (
        ("tune", "monday", "tuesday", "-o", "r.toml", "--save-map", "r.toml"),
        2,
        "--save-map: r.toml is that of --out",
    ),
    "over a truth": (
        ("tune", "monday", "tuesday", "--truth", "D.npy", "--save-map", "D.npy"),
        2,
        "--save-map: D.npy is what is read here",
    ),
    "over odometry": (
        ("run", "monday", "tuesday", "--odometry", "D.npy", "--save-map", "D.npy"),
        2,
        "--save-map: D.npy is what is read here",
    ),
    "fixes over the page": (
        ("run", "monday", "tuesday", "-o", "a.html", "--report", "a.html"),
        2,
        "--report: a.html is that of --out",
    ),
    "a page of no ending": (
        ("run", "monday", "tuesday", "--save-map", "m.safetensors", "--report", "page"),
        2,
        "--report: expected a name that ends in .html, got page",
    ),
    "a page into no folder": (
        ("run", "monday", "tuesday", "--save-map", "m.safetensors", "--report", "no/a.html"),
        1,
        "--report no/a.html: expected a folder that exists",
    ),
    "fixes into no folder": (
        ("run", "monday", "tuesday", "--save-map", "m.safetensors", "-o", "no/a.csv"),
        1,
        "no/a.csv: cannot write the fixes: there is no folder",
    ),
    "a route that is not there": (
        ("run", "mondy", "tuesday"),
        1,
        "mondy: expected a map or images, got no such file or folder; did you mean monday?",
    ),
    "queries that are not there": (
        ("run", "monday", "tuesdy"),
        1,
        "tuesdy: expected images, a video or a bag, got no such file or folder; did you mean tuesday?",
    ),
    "a video that is not there": (
        ("run", "monday", "tues.mkv"),
        1,
        "tues.mkv: expected images, a video or a bag, got no such file or folder",
    ),
    "no queries": (("audit", "monday"), 2, "QUERIES: expected images or descriptors, got none"),
    "an image": (
        ("run", "monday/000.png", "monday/001.png", "tuesday/000.png"),
        2,
        "images of one folder",
    ),
    "a pattern without quotes": (
        ("run", "monday/000.png", "monday/001.png", "monday/002.png"),
        2,
        "got the image monday/000.png; if the shell made it of a pattern, give the folder, or "
        "quote the pattern: 'monday/*.png'",
    ),
    "a folder of folders": (
        ("run", "week", "tuesday"),
        1,
        "found none; left out: folder friday, folder monday; folders in it have some: week/friday, "
        "week/monday",
    ),
    "queries in a folder of folders": (("run", "monday", "week"), 1, "have some: week/friday, "),
    "build of a folder of folders": (("map", "build", "week"), 1, "have some: week/friday, "),
    "two topics": (("run", "monday_bag/drive.bag", "tuesday"), 1, "/back"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_gets_one_clear_message(name: str) -> None:
    arguments, code, words = MISTAKES[name]
    for day in ("friday", "monday"):
        shutil.copytree("monday", f"week/{day}")
    np.save("D.npy", np.ones((4, 3), np.float32))
    surefix.Map.from_descriptors(np.eye(4, dtype=np.float32)).save("built.safetensors")
    before = {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}
    said = " ".join(re.sub(r"[│╭╮╰╯─]", " ", surefix_(*arguments, code=code).stderr).split())
    assert words in said
    assert {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()} == before


def test_references_are_what_the_map_was_made_of(shown: list[Any]) -> None:
    bag, topic = "monday_bag/drive.bag", ("--topic", "/front")
    surefix_("map", "build", bag, *topic, "--stride", 2, "-o", "bag.safetensors")
    surefix_("map", "build", "monday", "--stride", 2, "-o", "half.safetensors")
    options = ("--truth", "identity", "--method", "single", "--stride", 2)
    images = np.load("monday.npy")
    for route, queries, references in (
        ("half.safetensors", ("tuesday",), "monday"),
        ("bag.safetensors", ("tuesday_bag/drive.bag", *topic), bag),
    ):
        surefix_("run", route, *queries, "--references", references)
        surefix_("eval", route, *queries, *options, "--references", references)
        for place in (0, 7, 19):
            np.testing.assert_array_equal(shown[-1][place], images[2 * place])
    few = ("eval", "monday", "tuesday", "--truth", "identity", "--references", "few.npy")
    np.save("few.npy", images[:5])
    said = surefix_(*few, code=1).stderr
    assert "--references few.npy: expected an image for each of 40 places, got 5" in said


def test_append_takes_what_build_takes() -> None:
    surefix_("map", "build", "monday.mkv", "-o", "m.safetensors")
    said = surefix_("map", "append", "m.safetensors", "tuesday.mkv").stdout
    assert "Added 40 places to m.safetensors: now 80 places" in said
    assert "warning: 40 names were in the map before: 0 to 39" in said
    said = surefix_("map", "append", "m.safetensors", "monday_bag/drive.bag", "--topic", "/front")
    assert "now 120 places" in said.stdout
    said = surefix_("map", "info", "m.safetensors").stdout
    assert re.search(r"repeated +places 40 to \d+.*have names that come before", said)
