"""Large maps through the wheel: mapped, built straight into a file, made longer."""

import os
import pickle
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

import surefix
from surefix import Map, Sad, SurefixError, SurefixFileError, SurefixValueError

FRAMES: npt.NDArray[np.uint8] = np.random.default_rng(3).integers(0, 256, (90, 24, 48, 3), np.uint8)
ROWS = np.random.default_rng(4).normal(size=(40, 33)).astype(np.float32)
POSITIONS = np.random.default_rng(5).normal(size=(90, 2))


class Lazy:
    """A sequence that is no list, such as a data set's images."""

    def __init__(self, frames: npt.NDArray[np.uint8]) -> None:
        self.frames = frames

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, index: int) -> npt.NDArray[np.uint8]:
        if index == 80:
            raise RuntimeError("a frame that cannot be had")
        return self.frames[index]


def saved(route: Map, folder: Path) -> bytes:
    route.save(folder / "saved")
    written = (folder / "saved").read_bytes()
    (folder / "saved").unlink()
    return written


@pytest.mark.parametrize("metric", ["cosine", "euclidean", "manhattan"])
@pytest.mark.parametrize("dtype", ["float32", "float16", "int8", "uint8"])
def test_a_mapped_map_is_the_same_map(dtype: str, metric: str, tmp_path: Path) -> None:
    rows = (ROWS * 20 + 100).clip(1, 120).astype(dtype)
    names = [f"é{place}" for place in range(40)]
    route = Map.from_descriptors(rows, metric, positions=POSITIONS[:40], names=names)
    file = tmp_path / "route.safetensors"
    route.save(file)
    read, mapped = Map.open(file), Map.open(file, mmap=True)
    for other in (read, mapped):
        assert repr(other) == repr(route)
        assert other.names == names
        np.testing.assert_array_equal(other.descriptors, rows)
        np.testing.assert_array_equal(other.positions, POSITIONS[:40])
        for query in (rows[7], ROWS[7]):
            assert other.distances(query).tobytes() == route.distances(query).tobytes()
    localizer = surefix.Localizer(mapped)
    localizer.push(rows[3])
    assert surefix.Localizer.restore(read, localizer.snapshot()).push(rows[4]) == localizer.push(
        rows[4]
    )


def test_a_mapped_map_outlives_the_replacement_and_the_removal_of_its_file(tmp_path: Path) -> None:
    file = tmp_path / "route.safetensors"
    Map.from_descriptors(ROWS).save(file)
    mapped = Map.open(file, mmap=True)
    mapped.save(file)
    Map.append(file, mapped)
    assert len(Map.open(file)) == 80
    file.unlink()
    np.testing.assert_array_equal(mapped.descriptors, ROWS)


@pytest.mark.parametrize("mmap", [False, True])
def test_files_that_cannot_be_opened_are_named(mmap: bool, tmp_path: Path) -> None:
    with pytest.raises(SurefixFileError, match="gone"):
        Map.open(tmp_path / "gone", mmap=mmap)
    (tmp_path / "text").write_text("hello")
    with pytest.raises(SurefixValueError, match="text: not a usable surefix map"):
        Map.open(tmp_path / "text", mmap=mmap)


@pytest.mark.parametrize("dtype", ["u8", "f32"])
def test_build_writes_what_from_images_saves(dtype: Any, tmp_path: Path) -> None:
    sad, file = Sad(size=(16, 8), patch=4, dtype=dtype), tmp_path / "route.safetensors"
    for images in (FRAMES, list(FRAMES), Lazy(FRAMES[:80])):
        count = len(images)
        whole = saved(Map.from_images(images, sad, positions=POSITIONS[:count]), tmp_path)
        Map.build(file, images, sad, positions=POSITIONS[:count])
        assert file.read_bytes() == whole
        Map.build(file, images[:50], sad, positions=POSITIONS[:50])
        Map.append(file, images[50:], positions=POSITIONS[50:count])
        assert file.read_bytes() == whole, "array images are numbered on"
    assert os.listdir(tmp_path) == ["route.safetensors"]


def test_progress_is_told_from_the_first_to_the_last_image(tmp_path: Path) -> None:
    heard: list[tuple[int, int]] = []
    Map.build(tmp_path / "route", FRAMES, progress=lambda *done: heard.append(done))
    assert (heard[0], heard[-1]) == ((0, 90), (90, 90))


def test_files_are_appended_under_their_names(tmp_path: Path) -> None:
    paths = [tmp_path / f"frame{index}.png" for index in range(9)]
    for path, frame in zip(paths, FRAMES, strict=False):
        Image.fromarray(frame).save(path)
    file = tmp_path / "route.safetensors"
    Map.build(file, paths[:4])
    Map.append(file, paths[4:])
    assert file.read_bytes() == saved(Map.from_images(tmp_path), tmp_path)
    assert Map.open(file).names == [path.name for path in paths]


def test_extended_is_the_map_of_all_descriptors(tmp_path: Path) -> None:
    whole = Map.from_descriptors(ROWS, positions=POSITIONS[:40], names=[str(i) for i in range(40)])
    parts = [
        Map.from_descriptors(
            ROWS[part], positions=POSITIONS[part], names=[str(i) for i in range(40)[part]]
        )
        for part in (slice(0, 13), slice(13, 40))
    ]
    assert saved(parts[0].extended(parts[1]), tmp_path) == saved(whole, tmp_path)
    assert len(parts[0]) == 13
    file = tmp_path / "route"
    parts[0].save(file)
    Map.append(file, parts[1])
    assert file.read_bytes() == saved(whole, tmp_path)


@pytest.mark.parametrize("screen", [None, "i8"])
def test_maps_go_through_bytes_and_pickle(screen: Any, tmp_path: Path) -> None:
    names = [f"lamp {i}" for i in range(40)]
    route = Map.from_descriptors(ROWS, positions=POSITIONS[:40], names=names, screen=screen)
    data = route.to_bytes()
    assert data == saved(route, tmp_path)
    for again in (Map.from_bytes(data, screen), pickle.loads(pickle.dumps(route))):
        assert (again.to_bytes(), again.screen) == (data, screen)
        assert again.distances(ROWS[3]).tobytes() == route.distances(ROWS[3]).tobytes()
    for at in range(0, len(data), 7):
        with pytest.raises(SurefixValueError):
            Map.from_bytes(data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :])


def test_damage_to_a_mapped_map_is_found_on_request(tmp_path: Path) -> None:
    data = bytearray(Map.from_descriptors(ROWS).to_bytes())
    (tmp_path / "whole").write_bytes(data)
    data[-400] ^= 1
    (tmp_path / "damaged").write_bytes(data)
    Map.open(tmp_path / "whole", mmap=True).verify()
    with pytest.raises(SurefixValueError, match="checksum"):
        Map.open(tmp_path / "damaged", mmap=True).verify()


def test_a_slice_is_the_map_of_its_places() -> None:
    route = Map.from_descriptors(ROWS, positions=POSITIONS[:40])
    part = Map.from_descriptors(ROWS[5:30], positions=POSITIONS[5:30])
    assert route.slice(5, 30).to_bytes() == part.to_bytes()
    for start, stop in [(0, 41), (7, 8), (9, 3)]:
        with pytest.raises(SurefixValueError):
            route.slice(start, stop)


def test_places_that_do_not_fit_are_refused_and_the_file_stays(tmp_path: Path) -> None:
    file = tmp_path / "route"
    route = Map.from_descriptors(ROWS)
    route.save(file)
    before = file.read_bytes()
    for more, words in (
        (
            Map.from_descriptors(ROWS[:, :9]),
            "33 x float32, cosine, got ready descriptors of 9 x float32",
        ),
        (Map.from_descriptors(ROWS, "euclidean"), "expected .*cosine, got .*euclidean"),
        (
            Map.from_descriptors(ROWS, positions=POSITIONS[:40]),
            "expected no positions, got positions of 2",
        ),
        (Map.from_images(FRAMES), "expected ready descriptors"),
    ):
        with pytest.raises(SurefixValueError, match=f"the map: cannot append: .*{words}"):
            route.extended(more)
        with pytest.raises(SurefixValueError, match=f"{file}: cannot append: .*{words}"):
            Map.append(file, more)
    with pytest.raises(SurefixValueError, match=f"{file}: cannot append: .*got images"):
        Map.append(file, FRAMES)
    with pytest.raises(SurefixValueError, match="positions: expected none beside a map"):
        Map.append(file, route, positions=POSITIONS)
    with pytest.raises(SurefixValueError, match="images"):
        Map.append(file, 3)  # type: ignore[arg-type]
    assert file.read_bytes() == before
    Map.build(file, FRAMES, positions=POSITIONS)
    for positions, words in (
        (None, "got no positions"),
        (POSITIONS[:2], "positions: expected 90 values, got 2"),
    ):
        with pytest.raises(SurefixValueError, match=words):
            Map.append(file, FRAMES, positions=positions)
    assert os.listdir(tmp_path) == ["route"]


def test_work_that_fails_or_is_stopped_leaves_nothing(tmp_path: Path) -> None:
    file = tmp_path / "route"

    def raising(done: int, _total: int) -> None:
        if done:
            raise KeyboardInterrupt

    with pytest.raises(SurefixError, match="stopped after 0 of 90"):
        Map.build(file, FRAMES, progress=lambda *_: False)
    with pytest.raises(KeyboardInterrupt):
        Map.build(file, FRAMES, progress=raising)
    with pytest.raises(SurefixValueError, match=r"80.*a frame that cannot be had"):
        Map.build(file, Lazy(FRAMES))
    with pytest.raises(SurefixFileError, match="missing"):
        Map.build(tmp_path / "missing" / "route", FRAMES)
    with pytest.raises(SurefixValueError, match="at least 2"):
        Map.build(file, FRAMES[:1])
    with pytest.raises(SurefixValueError, match="positions: expected 90 values, got 3"):
        Map.build(file, FRAMES, positions=POSITIONS[:3])
    assert os.listdir(tmp_path) == []
    Map.build(file, FRAMES)
    before = file.read_bytes()
    with pytest.raises(KeyboardInterrupt):
        Map.append(file, FRAMES, progress=raising)
    with pytest.raises(SurefixValueError, match="80"):
        Map.append(file, Lazy(FRAMES))
    assert file.read_bytes() == before
    assert os.listdir(tmp_path) == ["route"]


ENDLESS = """
import sys, time, numpy as np, surefix
class Slow:
    def __len__(self): return 100_000
    def __getitem__(self, index):
        if index == 64: print("at work", flush=True)
        time.sleep(0.001)
        return np.zeros((24, 48), np.uint8)
surefix.Map.build(sys.argv[1], Slow())
"""


def test_ctrl_c_ends_a_build_and_leaves_nothing(tmp_path: Path) -> None:
    command = [sys.executable, "-c", ENDLESS, str(tmp_path / "route")]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "at work\n"
        assert len(os.listdir(tmp_path)) == 1, "the file in the making"
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate(timeout=60)
    assert "KeyboardInterrupt" in stderr
    assert os.listdir(tmp_path) == []
