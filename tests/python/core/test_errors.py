"""Bad input: a clear error with the place, the expected and the given; nothing is half-changed."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import surefix
from surefix.simulate import Route

FRAMES = np.random.default_rng(0).integers(0, 255, (6, 16, 32), np.uint8)
EYE = np.eye(5, dtype=np.float32)
MAP = surefix.Map.from_descriptors(EYE)


def picture(path: Path, size: tuple[int, int] = (32, 16)) -> str:
    Image.new("L", size, 90).save(path)
    return str(path)


CASES: dict[str, tuple[Callable[[Path], Any], list[str]]] = {
    "a mask for gaps": (
        lambda _: surefix.match_distances(EYE, gaps=np.eye(1, 5, dtype=bool)[0]),
        ["gaps: expected indices of queries, got bool", "np.flatnonzero(mask)"],
    ),
    "a list of flags for gaps": (
        lambda _: surefix.match(MAP, EYE, gaps=[False] * 5),
        ["np.flatnonzero(mask)"],
    ),
    "a descriptor with an axis too many": (
        lambda _: surefix.Localizer(MAP).push(EYE[:1]),
        ["frame: expected a descriptor (5,), got float32 of the shape (1, 5)"],
    ),
    "the same on a map with a recipe": (
        lambda _: surefix.Localizer(
            surefix.Map.from_descriptors(EYE, recipe={"name": "mine"})
        ).push(EYE[:1]),
        ["expected a descriptor (5,)", '"mine"', "got float32 of the shape (1, 5)"],
    ),
    "a query of another type": (
        lambda _: surefix.Localizer(MAP).push(EYE[0].astype(np.float64)),
        ["descriptor: expected float32, got float64; convert it with array.astype(np.float32)"],
    ),
    "vectors of another type": (
        lambda _: surefix.post.Running(5).push(EYE[0].astype(np.float16)),
        ["vector: expected float32, got float16; convert it with array.astype(np.float32)"],
    ),
    "a file of descriptors as queries": (
        lambda _: surefix.match(MAP, "drive.npy"),
        ["queries: expected descriptors (m, 5)", "got the path drive.npy"],
    ),
    "positions of four coordinates": (
        lambda _: surefix.Map.from_descriptors(EYE, positions=np.zeros((5, 4))),
        ["positions: expected 2 or 3 coordinates a place, in metres, got 4"],
    ),
    "one string as names": (
        lambda _: surefix.Map.from_descriptors(EYE, names="abcde"),
        ["names: expected a sequence of strings, one a place, got a string"],
    ),
    "a negative dim": (
        lambda _: surefix.post.Running(-1),
        ["dim", "a whole number of 0 or more", "-1"],
    ),
    "a negative seed": (
        lambda _: surefix.evaluate(surefix.match(MAP, EYE), list(range(5))).auc_interval(
            1.0, seed=-1
        ),
        ["seed", "a whole number of 0 or more", "-1"],
    ),
    "an empty map": (
        lambda _: surefix.Map.from_descriptors(np.empty((0, 4), np.float32)),
        ["at least 2", "0"],
    ),
    "one place": (
        lambda _: surefix.Map.from_descriptors(np.ones((1, 4), np.float32)),
        ["at least 2", "1"],
    ),
    "one image": (lambda _: surefix.Map.from_images(FRAMES[:1]), ["at least 2", "1"]),
    "a NaN in a descriptor": (
        lambda _: surefix.Map.from_descriptors(np.where(EYE == 1, np.nan, EYE).astype(np.float32)),
        ["NaN", "row 0, index 0"],
    ),
    "a row of zeros under the cosine": (
        lambda _: surefix.Map.from_descriptors(np.vstack([EYE, 0 * EYE[:1]])),
        ["row 5", "zeros"],
    ),
    "an infinity in the distances": (
        lambda _: surefix.Matcher(3).push(np.array([0, np.inf, 1], np.float32)),
        ["distances", "inf", "index 1"],
    ),
    "a NaN in a matrix": (
        lambda _: surefix.match_distances(np.array([[1, 2], [3, np.nan]], np.float32)),
        ["row 1, index 1", "NaN"],
    ),
    "too few distances": (
        lambda _: surefix.Matcher(3).push(EYE[0]),
        ["expected 3 values", "got 5"],
    ),
    "a descriptor of the wrong dimension": (
        lambda _: surefix.Localizer(surefix.Map.from_descriptors(EYE)).push(np.ones(4, np.float32)),
        ["descriptor", "expected 5 values", "got 4"],
    ),
    "queries of the wrong dimension": (
        lambda _: surefix.match(surefix.Map.from_descriptors(EYE), np.ones((2, 4), np.float32)),
        ["5", "4"],
    ),
    "L above the number of places": (
        lambda _: surefix.Matcher(3, sequence_length=4),
        ["sequence_length", "from 1 to 3", "got 4"],
    ),
    "L of 0": (lambda _: surefix.Matcher(3, sequence_length=0), ["sequence_length", "got 0"]),
    "L below 0": (lambda _: surefix.Matcher(3, sequence_length=-1), ["sequence_length", "got -1"]),
    "L of two and a half": (
        lambda _: surefix.Matcher(3, sequence_length=2.5),
        ["sequence_length", "got 2.5"],
    ),
    "w above 1": (lambda _: surefix.Matcher(3, weight=1.01), ["weight", "from 0 to 1", "got 1.01"]),
    "w of NaN": (lambda _: surefix.Matcher(3, weight=float("nan")), ["weight", "NaN"]),
    "a smoothing of 0": (lambda _: surefix.Matcher(3, smoothing=0), ["smoothing", "got 0"]),
    "another gradient": (
        lambda _: surefix.Matcher(3, gradient="up"),
        ["gradient", "halved", "'up'"],
    ),
    "another floor": (lambda _: surefix.Matcher(3, floor="low"), ["floor", "running", "'low'"]),
    "the global floor in a stream": (
        lambda _: surefix.Matcher(3, floor="global"),
        ["floor", "stream"],
    ),
    "more memory than there is": (
        lambda _: surefix.Matcher(1 << 42, sequence_length=1 << 20),
        ["memory", str(1 << 42)],
    ),
    "a float SAD descriptor on a uint8 SAD map": (
        lambda _: surefix.Map.from_images(FRAMES).distances(
            surefix.Sad(dtype="f32").describe(FRAMES[0])
        ),
        ["uint8", "SAD", "float32"],
    ),
    "no speeds": (lambda _: surefix.Matcher(3, speeds=[]), ["speeds", "at least one", "none"]),
    "a speed that leaves the route": (
        lambda _: surefix.Matcher(5, sequence_length=3, speeds=[1.0, 9.0]),
        ["speeds", "got 9"],
    ),
    "an unknown option": (lambda _: surefix.Matcher(3, lenght=2), ["lenght", "sequence_length"]),
    "an unknown metric": (
        lambda _: surefix.Map.from_descriptors(EYE, metric="l7"),
        ["metric", "cosine", "l7"],
    ),
    "a patch that does not divide": (
        lambda _: surefix.Sad(size=(60, 32)),
        ["size", "patch (8)", "60 x 32"],
    ),
    "another type of SAD": (lambda _: surefix.Sad(dtype="f64"), ["dtype", "u8", "f64"]),
    "a float image": (
        lambda _: surefix.Sad().describe(EYE),
        ["image", "uint8", "float32", "astype"],
    ),
    "an image of five channels": (
        lambda _: surefix.Sad().describe(np.zeros((4, 4, 5), np.uint8)),
        ["(H, W, 3)", "(4, 4, 5)"],
    ),
    "an image without pixels": (
        lambda _: surefix.Sad().describe(np.zeros((0, 4), np.uint8)),
        ["image", "0"],
    ),
    "an image on a map of ready descriptors": (
        lambda _: surefix.Localizer(surefix.Map.from_descriptors(EYE)).push(FRAMES[0]),
        ["ready descriptors"],
    ),
    "images of two sizes": (
        lambda _: surefix.Map.from_images([FRAMES[0], FRAMES[1], FRAMES[2][:8]]),
        ["image 2", "32 x 16", "32 x 8"],
    ),
    "files of two sizes": (
        lambda tmp: surefix.Map.from_images(
            [picture(tmp / "a.png"), picture(tmp / "b.png", (30, 16))]
        ),
        ["b.png", "32 x 16", "30 x 16"],
    ),
    "a text file that is called an image": (
        lambda tmp: (
            (tmp / "x.png").write_text("hello"),
            surefix.Map.from_images([tmp / "x.png"] * 2),
        ),
        ["x.png"],
    ),
    "half a JPEG": (
        lambda tmp: (
            Image.effect_noise((200, 200), 50).save(tmp / "x.jpg"),
            (tmp / "x.jpg").write_bytes((tmp / "x.jpg").read_bytes()[:-500]),
            surefix.read_image(tmp / "x.jpg"),
        ),
        ["x.jpg", "truncated"],
    ),
    "a bool image": (lambda _: surefix.Sad().describe(EYE > 0), ["uint8", "bool", "255 * image"]),
    "a 32-bit image": (
        lambda _: surefix.Sad().describe(EYE.astype(np.int32)),
        ["uint16", "int32", "image.astype"],
    ),
    "one RGB image as a route": (
        lambda _: surefix.Map.from_images(np.zeros((8, 9, 3), np.uint8)),
        ["(n, H, W, 3)", "(8, 9, 3)"],
    ),
    "a number as images": (lambda _: surefix.Map.from_images(3), ["images", "int"]),
    "images for a map of ready descriptors": (
        lambda _: surefix.match(surefix.Map.from_descriptors(EYE), list(FRAMES)),
        ["descriptors (m, 5)", "ready"],
    ),
    "a patch below 0": (lambda _: surefix.Sad(patch=-8), ["patch", "-8"]),
    "a size of three": (lambda _: surefix.Sad(size=(64, 32, 1)), ["size", "(64, 32, 1)"]),
    "names that are none": (
        lambda _: surefix.Map.from_descriptors(EYE, names=[1, 2]),
        ["names", "strings"],
    ),
    "a metric of None": (lambda _: surefix.Map.from_descriptors(EYE, metric=7), ["metric", "7"]),
    "too many speeds": (
        lambda _: surefix.Matcher(9, speeds=[1.0] * 2000),
        ["speeds", "1024", "2000"],
    ),
    "half an image": (
        lambda tmp: (
            picture(tmp / "x.png", (64, 64)),
            (tmp / "x.png").write_bytes((tmp / "x.png").read_bytes()[:60]),
            surefix.read_image(tmp / "x.png"),
        ),
        ["x.png"],
    ),
    "an empty folder": (lambda tmp: surefix.Map.from_images(tmp), ["images", "found none"]),
    "a pattern that matches nothing": (
        lambda tmp: surefix.Map.from_images(tmp / "*.png"),
        ["*.png", "found none"],
    ),
    "positions of another route": (
        lambda _: surefix.Map.from_descriptors(EYE, positions=np.zeros((4, 2))),
        ["positions", "expected 5", "got 4"],
    ),
    "positions of one coordinate": (
        lambda _: surefix.Map.from_descriptors(EYE, positions=np.zeros((5, 1))),
        ["positions", "2 or 3"],
    ),
    "names of another route": (
        lambda _: surefix.Map.from_descriptors(EYE, names=["a"]),
        ["names", "expected 5", "got 1"],
    ),
    "a trust flag too few": (
        lambda _: surefix.match_distances(EYE, trusted=[True]),
        ["trusted", "expected 5", "got 1"],
    ),
    "a truth too short": (
        lambda _: surefix.evaluate(surefix.match_distances(EYE), np.arange(4)),
        ["truth", "expected 5", "got 4"],
    ),
    "a truth of halves": (
        lambda _: surefix.evaluate(surefix.match_distances(EYE), np.ones(5) / 2),
        ["truth", "whole"],
    ),
    "a truth below -1": (
        lambda _: surefix.evaluate(surefix.match_distances(EYE), [0, -2, 1, 2, 3]),
        ["-2", "query 1"],
    ),
    "another recall": (
        lambda _: surefix.evaluate(surefix.match_distances(EYE), [0] * 5, recall="all"),
        ["recall", "correct", "all"],
    ),
    "a foreign file as a map": (
        lambda tmp: (
            (tmp / "m").write_bytes(b"hello, world, this is no map"),
            surefix.Map.open(tmp / "m"),
        ),
        ["m:"],
    ),
    "a snapshot of nothing": (lambda _: surefix.Matcher.restore(b"nothing"), ["snapshot"]),
    "a snapshot of other options": (
        lambda _: surefix.Matcher.restore(surefix.Matcher(5).snapshot(), weight=0.5),
        ["snapshot", "weight: expected 0.5, got 0.99"],
    ),
    "a snapshot of another map": (
        lambda _: surefix.Localizer.restore(
            surefix.Map.from_descriptors(EYE + 1),
            surefix.Localizer(surefix.Map.from_descriptors(EYE)).snapshot(),
        ),
        ["snapshot", "another map"],
    ),
    "a route of one place": (lambda _: Route(places=1), ["places", "got 1"]),
    "a condition out of range": (lambda _: Route(places=5).revisit(light=2), ["light", "got 2"]),
    "an unknown condition": (lambda _: Route(places=5).traverse(rain=1), ["rain", "season"]),
}


@pytest.mark.parametrize("name", CASES)
def test_it_is_refused_in_clear_words(name: str, tmp_path: Path) -> None:
    act, words = CASES[name]
    with pytest.raises(surefix.SurefixError) as caught:
        act(tmp_path)
    assert isinstance(caught.value, ValueError)
    message = str(caught.value)
    assert all(word in message for word in words), message
    assert "\n" not in message


def test_a_missing_file_is_an_os_error(tmp_path: Path) -> None:
    for act in (surefix.Map.open, surefix.read_image, surefix.Map.from_images):
        with pytest.raises(surefix.SurefixFileError, match="nowhere"):
            act(tmp_path / "nowhere")
    with pytest.raises(OSError, match="nowhere"):
        surefix.Map.from_descriptors(EYE).save(tmp_path / "nowhere" / "map")


def test_a_newer_map_says_upgrade(tmp_path: Path) -> None:
    file = tmp_path / "map.safetensors"
    surefix.Map.from_descriptors(EYE).save(file)
    data = file.read_bytes()
    newer = data.replace(rb"\"version\":1", rb"\"version\":7")
    assert newer != data
    file.write_bytes(newer)
    with pytest.raises(surefix.SurefixValueError, match=r"format 7.*reads up to 1.*upgrade"):
        surefix.Map.open(file)


def test_a_refused_push_leaves_the_object_as_it_was() -> None:
    frames = Route(places=30, size=(64, 32)).reference()
    localizer = surefix.Localizer(surefix.Map.from_images(frames), sequence_length=3)
    for index in range(5):
        localizer.push(frames[index])
    before = localizer.snapshot()
    for bad in (
        np.zeros((4, 4, 5), np.uint8),
        np.full(2048, np.nan, np.float32),
        np.zeros(7, np.uint8),
        "no.png",
    ):
        with pytest.raises(surefix.SurefixError):
            localizer.push(bad)
    assert localizer.snapshot() == before


def test_a_callback_that_says_no_stops_the_build() -> None:
    heard = []

    def stop(done: int, total: int) -> bool:
        heard.append((done, total))
        return done < 64

    with pytest.raises(surefix.SurefixError, match=r"stopped after 64 of 300"):
        surefix.Map.from_images(Route(places=300, size=(64, 32)).reference(), progress=stop)
    assert heard == [(0, 300), (64, 300)]
    with pytest.raises(ZeroDivisionError):
        surefix.Map.from_images(FRAMES, progress=lambda done, total: 1 / 0)


@pytest.mark.slow
def test_ctrl_c_during_a_build_leaves_no_file_and_no_traceback(tmp_path: Path) -> None:
    # One image under many names: long to describe, quick to make.
    frames = tmp_path / "frames"
    frames.mkdir()
    Image.new("RGB", (640, 480), (90, 120, 40)).save(tmp_path / "one.bmp")
    for index in range(20_000):
        (frames / f"{index}.bmp").symlink_to(tmp_path / "one.bmp")
    out = tmp_path / "route.safetensors"
    command = [sys.executable, "-m", "surefix", "map", "build", str(frames), "-o", str(out)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    read = Path(f"/proc/{process.pid}/io")
    if not read.exists():
        process.kill()
        pytest.skip("needs /proc to see that the build has begun")
    while int(read.read_text().split()[1]) < 100_000_000:
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert said == "surefix: interrupted\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["frames", "one.bmp"]


def test_ctrl_c_stops_a_batch(tmp_path: Path) -> None:
    heard: list[tuple[int, int]] = []

    def stop(done: int, total: int) -> None:
        heard.append((done, total))
        if done:
            raise KeyboardInterrupt

    queries = np.random.default_rng(1).standard_normal((200, 5)).astype(np.float32)
    with pytest.raises(KeyboardInterrupt):
        surefix.match(surefix.Map.from_descriptors(EYE), queries, progress=stop)
    assert heard == [(0, 200), (64, 200)]


def test_a_forked_child_goes_on_alone() -> None:
    D = np.random.default_rng(2).random((30, 300), np.float32)
    expected = surefix.match_distances(D).place.tolist()
    child = os.fork()
    if child == 0:
        os._exit(0 if surefix.match_distances(D).place.tolist() == expected else 1)
    for _ in range(500):
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            break
        time.sleep(0.02)
    else:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        pytest.fail("the child hangs")
    assert os.waitstatus_to_exitcode(status) == 0


def test_a_file_is_no_folder_and_a_folder_must_be_there(tmp_path: Path) -> None:
    image, route = tmp_path / "notes.txt", tmp_path / "none" / "route.safetensors"
    image.write_text("sunny")
    with pytest.raises(
        surefix.SurefixFileError,
        match=r"notes.txt: .* it is a file, where a folder of images or a pattern",
    ):
        surefix.Map.from_images(image)
    with pytest.raises(
        surefix.SurefixFileError, match=r"cannot write the map: there is no folder .*none$"
    ):
        MAP.save(route)
