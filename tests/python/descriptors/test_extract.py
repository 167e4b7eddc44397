"""Describing a drive: in batches, a few images at a time, and resuming after an interruption."""

import os
import signal
import sqlite3
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

import surefix
import surefix.descriptors
from surefix.datasets import ImageArray, ImageFiles
from surefix.descriptors import Descriptor, extract
from surefix.simulate import Route

IMAGES = np.random.default_rng(3).integers(0, 256, (23, 6, 8, 3), dtype=np.uint8)


class Means:
    """A descriptor that counts its calls and images."""

    def __init__(self, name: str = "means", **recipe: object) -> None:
        self.name = name
        self.recipe = {"name": name, **recipe}
        self.batches: list[int] = []

    def describe(self, images: Any) -> Any:
        self.batches.append(len(images))
        return np.array([[*image.mean(axis=(0, 1)), image.std()] for image in images], np.float32)


EXPECTED = Means().describe(list(IMAGES))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "drive").mkdir()
    for index, image in enumerate(IMAGES):
        Image.fromarray(image).save(tmp_path / "drive" / f"frame{index}.png")
    return tmp_path / "drive"


@dataclass
class Frame:
    image: Any


def test_every_kind_of_images_gives_the_same_rows(folder: Path) -> None:
    paths = [folder / f"frame{index}.png" for index in range(len(IMAGES))]
    kinds: list[Any] = [
        folder,
        str(folder / "*.png"),
        paths,
        IMAGES,
        list(IMAGES),
        tuple(IMAGES),
        ImageArray(IMAGES),
        ImageFiles(paths),
        (image for image in IMAGES),
        iter(paths),
        (Frame(image) for image in IMAGES),
    ]
    for images in kinds:
        np.testing.assert_array_equal(extract(images, Means(), batch=5, progress=False), EXPECTED)


def test_a_generated_traverse_is_described() -> None:
    traverse = Route(places=7, size=(64, 32)).reference()
    rows = extract(traverse, Means(), batch=3, progress=False)
    np.testing.assert_array_equal(rows, Means().describe([traverse[i] for i in range(7)]))


def test_the_rows_make_a_map(tmp_path: Path) -> None:
    rows = extract(IMAGES, Means(), cache=tmp_path / "c", progress=False)
    route = surefix.Map.from_descriptors(rows, metric="euclidean")
    np.testing.assert_array_equal(route.descriptors, EXPECTED)


@pytest.mark.parametrize("batch", [1, 2, 5, 23, 100])
def test_batches_are_full_but_for_the_last(batch: int) -> None:
    means = Means()
    extract(IMAGES, means, batch=batch, progress=False)
    assert sum(means.batches) == len(IMAGES)
    assert all(size == batch for size in means.batches[:-1])


def test_no_more_than_two_batches_of_images_are_held() -> None:
    alive: set[int] = set()
    most = 0

    class Held(np.ndarray[Any, Any]):
        number = -1

        def __del__(self) -> None:
            alive.discard(self.number)

    def images() -> Iterator[Any]:
        nonlocal most
        for index in range(60):
            image = np.zeros((4, 4), np.uint8).view(Held)
            image.number = index
            alive.add(index)
            most = max(most, len(alive))
            yield image
            del image

    class Zeros(Means):
        def describe(self, images: Any) -> Any:
            return np.zeros((len(images), 2), np.float32)

    extract(images(), Zeros(), batch=4, progress=False)
    # Two batches, and one that the generator has in its hand.
    assert most <= 9


def test_progress_is_told_after_each_batch_and_may_stop(tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    extract(IMAGES, Means(), batch=10, progress=lambda *call: told.append(call))
    assert told == [(10, 23), (20, 23), (23, 23)]
    told.clear()
    extract(iter(IMAGES), Means(), batch=10, progress=lambda *call: told.append(call))
    assert told == [(10, 11), (20, 21), (23, 24), (23, 23)]
    with pytest.raises(surefix.SurefixError, match="stopped after 10 of 23"):
        extract(IMAGES, Means(), batch=10, cache=tmp_path / "c", progress=lambda done, _: done < 10)
    means = Means()
    extract(IMAGES, means, batch=10, cache=tmp_path / "c", progress=False)
    assert sum(means.batches) == 13


def test_a_cache_spares_the_work_and_goes_on_with_more_images(folder: Path, tmp_path: Path) -> None:
    cache = tmp_path / "drive.cache"
    last = folder / "frame22.png"
    aside = last.rename(tmp_path / "frame22.png")
    first = extract(folder, Means(), cache=cache, progress=False)
    np.testing.assert_array_equal(first, EXPECTED[:22])
    assert not first.flags.writeable
    again = Means()
    np.testing.assert_array_equal(
        extract(folder, again, cache=cache, progress=False), EXPECTED[:22]
    )
    assert again.batches == []
    aside.rename(last)
    more = Means()
    np.testing.assert_array_equal(extract(folder, more, cache=cache, progress=False), EXPECTED)
    assert more.batches == [1]


@pytest.mark.parametrize("kind", ["arrays", "generator", "lazy"])
def test_a_cache_of_pixels_is_known_by_them(kind: str, tmp_path: Path) -> None:
    def images(pixels: Any) -> Any:
        return {"arrays": pixels, "generator": iter(pixels), "lazy": ImageArray(pixels)}[kind]

    cache = tmp_path / "c"
    extract(images(IMAGES[:9]), Means(), cache=cache, batch=4, progress=False)
    means = Means()
    np.testing.assert_array_equal(
        extract(images(IMAGES), means, cache=cache, batch=4, progress=False), EXPECTED
    )
    assert sum(means.batches) == 14
    other = IMAGES.copy()
    other[12, 0, 0, 0] ^= 1
    before = cache.read_bytes()
    with pytest.raises(surefix.SurefixValueError, match="record 12 is not of 12 as it is now"):
        extract(images(other), Means(), cache=cache, progress=False)
    with pytest.raises(
        surefix.SurefixValueError, match="expected the cache of these 5 images, got one of 23"
    ):
        extract(images(IMAGES[:5]), Means(), cache=cache, progress=False)
    assert cache.read_bytes() == before


def test_a_file_cut_anywhere_is_resumed_or_refused(tmp_path: Path) -> None:
    """A killed process cannot leave one behind, a full disk or a copy can."""
    cache = tmp_path / "c"
    extract(IMAGES[:6], Means(), cache=cache, progress=False)
    whole = cache.read_bytes()
    refused = []
    for length in range(0, len(whole), 509):
        cache.write_bytes(whole[:length])
        try:
            rows = extract(IMAGES[:6], Means(), cache=cache, progress=False)
        except surefix.SurefixValueError as error:
            refused.append(str(error))
        else:
            np.testing.assert_array_equal(rows, EXPECTED[:6])
    assert len(refused) > 10
    assert all("expected a cache of descriptors, got" in said for said in refused)


def test_a_record_that_the_disk_lost_is_made_again(tmp_path: Path) -> None:
    cache = tmp_path / "c"
    extract(IMAGES, Means(), cache=cache, progress=False)
    rng = np.random.default_rng(0)
    for column, torn in (("vector", bytes(16)), ("vector", b""), ("digest", bytes(8))):
        record = int(rng.integers(0, len(IMAGES)))
        with closing(sqlite3.connect(cache)) as file, file:
            file.execute(f"UPDATE vectors SET {column} = ? WHERE row = ?", (torn, record))
        means = Means()
        np.testing.assert_array_equal(extract(IMAGES, means, cache=cache, progress=False), EXPECTED)
        assert sum(means.batches) == len(IMAGES) - record
    with closing(sqlite3.connect(cache)) as file, file:
        file.execute("DELETE FROM vectors WHERE row = 20")
    means = Means()
    np.testing.assert_array_equal(extract(IMAGES, means, cache=cache, progress=False), EXPECTED)
    assert sum(means.batches) == 3


@pytest.mark.slow
def test_several_processes_use_one_cache(folder: Path, tmp_path: Path) -> None:
    cache = tmp_path / "c"
    code = f"""
        import sys
        sys.path.insert(0, {str(Path(__file__).parent)!r})
        from test_extract import EXPECTED, Means
        from surefix.descriptors import extract

        rows = extract({str(folder)!r}, Means(), batch=2, cache={str(cache)!r}, progress=False)
        assert (rows == EXPECTED).all()
    """
    command = [sys.executable, "-c", textwrap.dedent(code)]
    with ExitStack() as running:
        processes = [
            running.enter_context(subprocess.Popen(command, stderr=subprocess.PIPE))
            for _ in range(3)
        ]
        said = [process.communicate(timeout=120)[1] for process in processes]
    assert [process.returncode for process in processes] == [0, 0, 0], said
    means = Means()
    np.testing.assert_array_equal(extract(folder, means, cache=cache, progress=False), EXPECTED)
    assert means.batches == []


def test_a_process_that_begins_with_other_images_meanwhile_is_found_out(tmp_path: Path) -> None:
    cache = tmp_path / "c"

    class Slow(Means):
        def describe(self, images: Any) -> Any:
            if not cache.exists():
                extract(IMAGES[5:9], Means(), cache=cache, progress=False)
            return super().describe(images)

    with pytest.raises(surefix.SurefixValueError, match="record 0 is not of 0 as it is now"):
        extract(IMAGES, Slow(), cache=cache, progress=False)
    means = Means()
    rows = extract(IMAGES[5:9], means, cache=cache, progress=False)
    np.testing.assert_array_equal(rows, EXPECTED[5:9])
    assert means.batches == []


def test_a_killed_process_loses_at_most_a_batch(folder: Path, tmp_path: Path) -> None:
    cache = tmp_path / "c"
    code = f"""
        import sys, time
        sys.path.insert(0, {str(Path(__file__).parent)!r})
        from test_extract import Means
        from surefix.descriptors import extract

        class Slow(Means):
            def describe(self, images):
                if sum(self.batches) >= 12:
                    print("working", flush=True)
                    time.sleep(60)
                return super().describe(images)

        extract({str(folder)!r}, Slow(), batch=3, cache={str(cache)!r}, progress=False)
    """
    with subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code)], stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"working\n"
        process.send_signal(signal.SIGKILL)
    means = Means()
    np.testing.assert_array_equal(extract(folder, means, cache=cache, progress=False), EXPECTED)
    assert sum(means.batches) == len(IMAGES) - 12


def test_a_cache_of_something_else_is_refused_and_stays(folder: Path, tmp_path: Path) -> None:
    cache = tmp_path / "c"
    extract(folder, Means(size=[4, 4]), cache=cache, progress=False)
    whole = cache.read_bytes()
    with pytest.raises(
        surefix.SurefixValueError, match="expected a cache of others, got one of means"
    ):
        extract(folder, Means("others"), cache=cache, progress=False)
    with pytest.raises(surefix.SurefixValueError, match=r"whose size is \[4, 4\], not \[8, 4\]"):
        extract(folder, Means(size=[8, 4]), cache=cache, progress=False)
    os.utime(folder / "frame4.png", (1, 1))
    with pytest.raises(
        surefix.SurefixValueError, match=r"record 4 is not of frame4\.png as it is now"
    ):
        extract(folder, Means(size=[4, 4]), cache=cache, progress=False)
    assert cache.read_bytes() == whole
    other = tmp_path / "other.sqlite"
    with closing(sqlite3.connect(other)) as file:
        file.execute("CREATE TABLE mine (a)")
    for content in (
        b"something else entirely",
        b"\0" * 100,
        whole.replace(b"{", b"[", 1),
        other.read_bytes(),
    ):
        cache.write_bytes(content)
        with pytest.raises(surefix.SurefixValueError, match="expected a cache of descriptors"):
            extract(folder, Means(size=[4, 4]), cache=cache, progress=False)
        assert cache.read_bytes() == content
    with pytest.raises(surefix.SurefixFileError, match="there is no folder"):
        extract(folder, Means(), cache=tmp_path / "no" / "c", progress=False)


class Wrong(Means):
    def __init__(self, answer: Any) -> None:
        super().__init__()
        self.answer = answer

    def describe(self, images: Any) -> Any:
        return self.answer(images)


def test_what_is_no_descriptor_and_no_image_is_named(folder: Path, tmp_path: Path) -> None:
    assert isinstance(Means(), Descriptor)
    with pytest.raises(surefix.SurefixValueError, match="got Sad without name and recipe"):
        extract(IMAGES, surefix.Sad(), progress=False)  # type: ignore[arg-type]
    cases: list[tuple[Any, Any, str]] = [
        (IMAGES[0], Means(), r"expected \(n, H, W\) or \(n, H, W, 3\)"),
        (7, Means(), "expected a folder, a pattern, or images or paths"),
        ([], Means(), "expected at least one, got none"),
        (iter([]), Means(), "expected at least one, got none"),
        (
            [np.zeros((4, 4), np.float32)],
            Means(),
            r"image 0: expected uint8 .* got float32 \(4, 4\)",
        ),
        ([IMAGES[0], np.zeros((4, 4, 5), np.uint8)], Means(), r"image 1: expected uint8"),
        (
            IMAGES,
            Wrong(lambda images: np.zeros(3)),
            r"means: expected a vector an image, \(8, dim\) for 8 images",
        ),
        (IMAGES, Wrong(lambda images: np.zeros((len(images), 0))), "expected a vector an image"),
        (IMAGES, Wrong(lambda images: [["a"]] * len(images)), "expected numbers"),
        (IMAGES, Wrong(lambda images: None), "expected numbers"),
        (
            IMAGES,
            Wrong(lambda images: np.zeros((len(images), len(images)))),
            "image 16: expected a vector of 8 numbers",
        ),
    ]
    for images, descriptor, message in cases:
        for cache in (None, tmp_path / "c"):
            if "of 8 numbers" in message and cache is not None:
                continue
            with pytest.raises(surefix.SurefixValueError, match=message):
                extract(images, descriptor, cache=cache, progress=False)
            assert not (tmp_path / "c").exists()
    with pytest.raises(surefix.SurefixValueError, match="batch: expected a whole number"):
        extract(IMAGES, Means(), batch=0)
    (folder / "frame9.png").write_bytes(b"no image")
    with pytest.raises(surefix.SurefixValueError, match=r"frame9\.png"):
        extract(folder, Means(), batch=2, cache=tmp_path / "c", progress=False)
    # Nothing that was made before it is lost.
    Image.fromarray(IMAGES[9]).save(folder / "frame9.png")
    means = Means()
    extract(folder, means, batch=2, cache=tmp_path / "c", progress=False)
    assert sum(means.batches) == 23 - 8


def test_a_number_that_is_none_is_found_wherever_it_is(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    for _ in range(40):
        image, index = int(rng.integers(0, 23)), int(rng.integers(0, 300))
        value = rng.choice([np.nan, np.inf, -np.inf])
        rows = rng.standard_normal((23, 300)).astype(np.float32) * np.float32(1e37)
        rows[image, index] = value

        class Given(Means):
            def describe(self, images: Any, rows: Any = rows) -> Any:
                self.batches.append(len(images))
                done = sum(self.batches)
                return rows[done - len(images) : done]

        with pytest.raises(
            surefix.SurefixValueError,
            match=rf"got -?(nan|inf) for image {image}, at index {index} of",
        ):
            extract(IMAGES, Given(), progress=False)


@pytest.mark.parametrize(
    ("module", "call", "message"),
    [
        (
            "onnxruntime",
            lambda d: d.Onnx(__file__),
            'takes onnxruntime, which is not .*: pip install "surefix.learned."',
        ),
        (
            "h5py",
            lambda d: d.load("a.h5"),
            'takes h5py, which is not installed: pip install "surefix.files."',
        ),
        (
            "faiss",
            lambda d: d.metric_of("a.faiss"),
            'takes faiss, which is not installed: pip install "surefix.faiss."',
        ),
        (
            "torch",
            lambda d: d.Torch(None),
            'takes PyTorch, which is not .*: pip install "surefix.torch."',
        ),
        (
            "torch",
            lambda d: d.from_hub("megaloc"),
            "the model megaloc takes PyTorch, which is not installed",
        ),
        ("onnxruntime", lambda d: d.XFeat(__file__), "takes onnxruntime, which is not installed"),
        ("torch", lambda d: d.XFeat(), "XFeat without a file takes PyTorch, which is not"),
        (
            "safetensors.numpy",
            lambda d: d.Reranker(SimpleNamespace(features=len, scores=len), ["a"]).save("a", None),
            'a file of local features takes safetensors, .*: pip install "surefix.learned."',
        ),
    ],
)
def test_a_missing_package_is_named_in_a_line(
    module: str, call: Any, message: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.chdir(tmp_path)
    Path("a.h5").touch()
    with pytest.raises(surefix.SurefixError, match=message) as caught:
        call(surefix.descriptors)
    assert "\n" not in str(caught.value)


def test_nothing_optional_is_imported_before_it_is_used() -> None:
    code = """
        import sys, surefix.descriptors as d
        assert "surefix.descriptors.onnx" not in sys.modules
        d.Onnx, d.Torch, d.PatchNetVlad, d.XFeat, d.Reranker, d.from_hub, d.load, d.extract, d.reranked_distances
        optional = {"onnxruntime", "torch", "PIL", "h5py", "faiss", "safetensors", "patchnetvlad", "cv2"}
        assert not optional & set(sys.modules), optional & set(sys.modules)
        assert callable(d.extract) and set(d.__all__) <= set(dir(d))
    """
    subprocess.run([sys.executable, "-c", textwrap.dedent(code)], check=True)


def test_positions_that_do_not_fit_are_refused_before_anything_is_described(
    folder: Path, tmp_path: Path
) -> None:
    network = Means()
    route = tmp_path / "route.safetensors"
    for wrong, message in (
        (np.zeros((22, 2)), "positions: expected 23 values, got 22"),
        (np.full((23, 2), np.nan), "positions"),
    ):
        with pytest.raises(surefix.SurefixError, match=message):
            surefix.Map.from_images(folder, network, positions=wrong)
    surefix.Map.from_images(folder, network, positions=np.zeros((23, 2))).save(route)
    described = len(network.batches)
    assert described > 0
    with pytest.raises(surefix.SurefixError, match="positions: expected 23 values, got 24"):
        surefix.Map.append(route, folder, network, positions=np.zeros((24, 2)))
    assert len(network.batches) == described
    surefix.Map.append(route, folder, network, positions=np.ones((23, 2)))
    assert len(surefix.Map.open(route)) == 46


def test_a_network_under_another_name_is_the_same_only_where_a_file_says_so(tmp_path: Path) -> None:
    first, renamed = Means("a", sha256="12", file="a.onnx"), Means("b", sha256="12", file="b.onnx")
    vector = Means().describe(IMAGES[:1])[0]
    route = surefix.Map.from_images(IMAGES, first)
    kept = tmp_path / "rows.cache"
    rows = extract(IMAGES, first, cache=kept, progress=False)
    np.testing.assert_array_equal(extract(IMAGES, renamed, cache=kept, progress=False), rows)
    assert renamed.batches == []
    assert surefix.Localizer(route, descriptor=renamed).push(IMAGES[0]) == surefix.Localizer(
        route
    ).push(vector)
    for other in (
        Means("b"),
        Means("b", sha256="13", file="a.onnx"),
        Means("b", sha256="12", size=3),
    ):
        with pytest.raises(
            surefix.SurefixValueError, match='expected "a", as the map\'s own, got "b"'
        ):
            surefix.Localizer(route, descriptor=other)
        with pytest.raises(surefix.SurefixValueError, match="expected a cache of b, got one of a"):
            extract(IMAGES, other, cache=kept, progress=False)
    # Without the contents of a file, the name is all that is known.
    plain = surefix.Map.from_images(IMAGES, Means("a"))
    with pytest.raises(surefix.SurefixValueError, match='expected "a", as the map\'s own'):
        surefix.Localizer(plain, descriptor=Means("b"))
