"""``surefix map build`` with a network, and with the files of ready descriptors that other programs
write.
"""

import csv
import json
import re
import subprocess
import sys
from functools import partial
from pathlib import Path

import faiss
import h5py
import numpy as np
import pytest
from PIL import Image
from safetensors.numpy import save_file

import commands
import surefix
import tiny_network
from recordings import write_video
from surefix.descriptors import Onnx, extract
from surefix.post import Normalize
from surefix.simulate import Route

surefix_ = partial(commands.surefix_, COLUMNS="400")
PLACES = 30


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("learned")
    (folder / "summer").mkdir()
    reference = Route(places=PLACES, size=(64, 32)).reference()
    for index in range(PLACES):
        Image.fromarray(reference[index]).save(folder / "summer" / f"frame{index}.png")
    tiny_network.save(folder / "tiny.onnx")
    return folder


def test_a_drive_is_localized_by_the_network_that_made_the_map(drive: Path, tmp_path: Path) -> None:
    out = tmp_path / "route.safetensors"
    made = ("--model", drive / "tiny.onnx", "--output", "map", "--size", "32x16")
    surefix_(
        "map", "build", drive / "summer", "-o", out, *made, "--post", "standardize,pca:12,normalize"
    )
    route = surefix.Map.open(out)
    assert (route.input_dim, route.dim) == (640, 12)
    assert route.recipe is not None
    done = surefix_("run", out, drive / "summer", "--model", drive / "tiny.onnx")
    rows = list(csv.DictReader(done.stdout.splitlines()))
    network = Onnx(drive / "tiny.onnx", "map", (32, 16))
    localizer = surefix.Localizer(route, motion="any")
    fixes = [
        localizer.push(vector) for vector in extract(drive / "summer", network, progress=False)
    ]
    assert [(int(row["place"]), row["score"]) for row in rows] == [
        (fix.place, str(fix.score)) for fix in fixes
    ]
    assert [fix.place for fix in fixes] == list(range(PLACES))
    other = tmp_path / "tiny.onnx"
    other.write_bytes((drive / "tiny.onnx").read_bytes())
    surefix_("run", out, drive / "summer", "--model", other)
    # The map says which it is, and it lies where it was used last.
    again = surefix_("run", out, drive / "summer")
    assert [row["place"] for row in csv.DictReader(again.stdout.splitlines())] == [
        row["place"] for row in rows
    ]
    other.unlink()
    without = surefix_("run", out, drive / "summer", code=2)
    assert "add --model FILE" in without.stderr
    assert "0 fixes" not in without.stderr
    other.write_bytes((drive / "tiny.onnx").read_bytes())
    sad = tmp_path / "sad.safetensors"
    surefix_("map", "build", drive / "summer", "-o", sad)
    assert (
        "which names none"
        in surefix_("run", sad, drive / "summer", "--model", other, code=2).stderr
    )
    for post in ("sharpen", "standardize:own", "pca", "pca:x", "normalize:3", ""):
        refused = surefix_(
            "map", "build", drive / "summer", "-o", sad, *made, "--post", post, code=2
        )
        assert "--post: expected standardize, standardize:running, pca:N" in refused.stderr
    assert (
        "got images for SAD"
        in surefix_("map", "build", drive / "summer", "-o", sad, "--post", "pca:3", code=2).stderr
    )


def test_a_map_is_made_by_a_network(drive: Path, tmp_path: Path) -> None:
    out, cache = tmp_path / "route.safetensors", tmp_path / "summer.cache"
    options = (
        "--model",
        drive / "tiny.onnx",
        "--output",
        "map",
        "--size",
        "32x16",
        "--cache",
        cache,
    )
    done = surefix_("map", "build", drive / "summer", "-o", out, *options)
    assert re.fullmatch(
        rf"Made {re.escape(str(out))}: 30 places x 640 float32, 0\.1 MB, in [\d.]+ s\n", done.stdout
    )
    network = Onnx(drive / "tiny.onnx", "map", (32, 16))
    route = surefix.Map.open(out)
    np.testing.assert_array_equal(
        route.descriptors, extract(drive / "summer", network, progress=False)
    )
    assert route.metric == "cosine"
    assert route.names == [f"frame{index}.png" for index in range(PLACES)]
    # All is in the cache: the same map again.
    before = out.read_bytes()
    surefix_("map", "build", drive / "summer", "-o", out, *options)
    assert out.read_bytes() == before
    plain = ("--mean", "none", "--std", "none", "--metric", "euclidean")
    surefix_("map", "build", drive / "summer", "-o", out, *options[:-2], *plain)
    expected = extract(
        drive / "summer", Onnx(drive / "tiny.onnx", "map", (32, 16), None, None), progress=False
    )
    np.testing.assert_array_equal(surefix.Map.open(out).descriptors, expected)
    assert surefix.Map.open(out).metric == "euclidean"


def test_a_map_by_a_network_is_made_longer_by_it(drive: Path, tmp_path: Path) -> None:
    route, whole, first = (tmp_path / f"{name}.safetensors" for name in ("route", "whole", "first"))
    images = sorted((drive / "summer").iterdir(), key=lambda path: int(path.stem[5:]))
    for part, chosen in (("first", images[:20]), ("rest", images[20:])):
        (tmp_path / part).mkdir()
        for image in chosen:
            (tmp_path / part / image.name).symlink_to(image)
    made = (
        "--model",
        drive / "tiny.onnx",
        "--output",
        "map",
        "--size",
        "32x16",
        "--post",
        "normalize",
    )
    surefix_("map", "build", drive / "summer", "-o", whole, *made)
    surefix_("map", "build", tmp_path / "first", "-o", route, *made)
    first.write_bytes(route.read_bytes())
    cache = tmp_path / "rest.cache"
    said = surefix_(
        "map", "append", route, tmp_path / "rest", "--model", drive / "tiny.onnx", "--cache", cache
    ).stdout
    assert said.startswith(f"Added 10 places to {route}: now 30 places x 640 float32")
    assert route.read_bytes() == whole.read_bytes()
    assert cache.exists()

    # The same network in a file of another name, in memory, on the disk and in the cache.
    renamed = tmp_path / "renamed.onnx"
    renamed.write_bytes((drive / "tiny.onnx").read_bytes())
    route.write_bytes(first.read_bytes())
    surefix_("map", "append", route, tmp_path / "rest", "--model", renamed, "--cache", cache)
    assert route.read_bytes() == whole.read_bytes()
    fixes = [
        [
            (row["place"], row["score"], row["trusted"])
            for row in csv.DictReader(
                surefix_("run", whole, drive / "summer", "--model", model).stdout.splitlines()
            )
        ]
        for model in (drive / "tiny.onnx", renamed)
    ]
    assert fixes[0] == fixes[1]
    assert len(fixes[0]) == PLACES

    network = Onnx(drive / "tiny.onnx", "map", (32, 16))
    surefix.Map.append(
        first, (np.zeros((16, 32, 3), np.uint8) + 9 * index for index in range(3)), network
    )
    longer = surefix.Map.open(first)
    assert (len(longer), longer.names and longer.names[19:]) == (
        23,
        ["frame19.png", "20", "21", "22"],
    )
    with pytest.raises(surefix.SurefixValueError, match="expected the map's own, by the recipe"):
        surefix.Map.append(first, tmp_path / "rest", Onnx(drive / "tiny.onnx", "map", (16, 16)))
    with pytest.raises(
        surefix.SurefixValueError, match="learned descriptor; images for Sad need none, got Sad"
    ):
        surefix.Map.append(first, tmp_path / "rest", surefix.Sad())  # type: ignore[arg-type]
    with pytest.raises(
        surefix.SurefixValueError, match="expected images and a learned descriptor, got a map"
    ):
        surefix.Map.append(first, longer, network)
    sad, rows = tmp_path / "sad.safetensors", tmp_path / "rows.npy"
    np.save(rows, np.eye(4, 640, dtype=np.float32))
    surefix_("map", "build", tmp_path / "rest", "-o", sad)
    with pytest.raises(
        surefix.SurefixValueError, match=r"expected Sad\(.*as the map's own, got 'onnx:"
    ):
        surefix.Map.append(sad, tmp_path / "rest", network)
    for arguments, message in (
        ((sad, tmp_path / "rest", "--cache", cache), "--cache: expected images for a network"),
        ((first, rows, "--model", drive / "tiny.onnx"), "--model: expected images"),
        ((sad, tmp_path / "rest", "--model", drive / "tiny.onnx"), "which names none"),
    ):
        said = surefix_("map", "append", *arguments, code=2).stderr
        assert message in " ".join(re.sub(r"[│╭╮╰╯─]", " ", said).split())
    assert len(surefix.Map.open(first)) == 23


def test_what_is_said_of_a_map_by_a_network(drive: Path, tmp_path: Path) -> None:
    out = tmp_path / "route.safetensors"
    made = ("--model", drive / "tiny.onnx", "--output", "map", "--size", "32x16")
    surefix_(
        "map", "build", drive / "summer", "-o", out, *made, "--post", "standardize:running,pca:12"
    )
    said = surefix_("map", "info", out).stdout
    assert re.search(
        r"descriptor +onnx:.*: queries come as its descriptors, or as images with it", said
    )
    assert (
        "Post(Standardize(statistics='running'), Pca(dim=12, whiten=True), from 640 to 12 numbers)"
        in said
    )
    facts = json.loads(surefix_("map", "info", out, "--json").stdout)
    assert (facts["dim"], facts["input_dim"], facts["recipe"]["output"]) == (12, 640, "map")
    assert facts["post"] == [
        {"step": "standardize_running"},
        {"step": "pca", "dim": 12, "whiten": True},
    ]


def test_a_recording_is_mapped_by_a_network(drive: Path, tmp_path: Path) -> None:
    images = [np.asarray(Image.open(path)) for path in sorted((drive / "summer").iterdir())]
    video = write_video(tmp_path / "drive.mkv", images)
    out, cache, few = tmp_path / "route.safetensors", tmp_path / "video.cache", tmp_path / "few.npy"
    np.save(few, 1000.0 * np.arange(62).reshape(31, 2))
    made = ("--model", drive / "tiny.onnx", "--output", "map", "--size", "32x16", "--stride", 3)
    surefix_("map", "build", video, "-o", out, *made, "--post", "normalize", "--cache", cache)
    network = Onnx(drive / "tiny.onnx", "map", (32, 16))
    route = surefix.Map.open(out)
    expected = surefix.Map.from_images(images[::3], network, post=[Normalize()], progress=False)
    np.testing.assert_array_equal(route.descriptors, expected.descriptors)
    assert (route.recipe, route.post) == (expected.recipe, expected.post)
    assert route.names == [str(index) for index in range(0, PLACES, 3)]
    done = surefix_("run", out, video, "--model", drive / "tiny.onnx")
    assert len(done.stdout.splitlines()) == PLACES + 1
    refused = surefix_("map", "build", video, "-o", out, *made, "--positions", few, code=1).stderr
    assert f"{video}: expected a frame for each of 31 positions in {few}, got 10" in refused
    for arguments, message in (
        ((video, "--post", "normalize"), "got images for SAD"),
        ((video, "--key", "a"), "--key: expected descriptors"),
    ):
        said = surefix_("map", "build", *arguments, "-o", out, code=2).stderr
        assert message in " ".join(re.sub(r"[│╭╮╰╯─]", " ", said).split())
    assert len(surefix.Map.open(out)) == 10


def test_two_folders_take_an_output_of_the_network(drive: Path, tmp_path: Path) -> None:
    folders, model = (drive / "summer", drive / "summer"), ("--model", drive / "tiny.onnx")
    kept, built = tmp_path / "kept.safetensors", tmp_path / "built.safetensors"
    ran = surefix_("run", *folders, *model, "--output", "map", "--save-map", kept)
    surefix_("map", "build", folders[0], "-o", built, *model, "--output", "map")
    first, second = surefix.Map.open(kept), surefix.Map.open(built)
    np.testing.assert_array_equal(first.descriptors, second.descriptors)
    rows = surefix_("run", built, folders[1], "--output", "map").stdout.splitlines()
    assert [row.split(",")[2] for row in ran.stdout.splitlines()] == [
        row.split(",")[2] for row in rows
    ]
    for place, options, message in (
        (folders[0], model, "expected --output NAME, as the model has several"),
        (folders[0], ("--output", "map"), "--output: expected --model too"),
        (built, ("--output", "mean"), "--output: expected map, which"),
    ):
        said = surefix_("run", place, folders[1], *options, code=2).stderr
        assert message in " ".join(re.sub(r"[│╭╮╰╯─]", " ", said).split())


def test_mistakes_with_a_network_are_said_in_a_line(drive: Path, tmp_path: Path) -> None:
    np.save(tmp_path / "rows.npy", np.eye(4, dtype=np.float32))
    out, model, summer = tmp_path / "out", drive / "tiny.onnx", drive / "summer"
    usage = (
        ((summer, "--model", model), "expected --output NAME, as the model has several"),
        ((summer, "--model", model, "--output", "maps"), "got 'maps'"),
        ((summer, "--model", model, "--output", "map", "--size", "big"), "expected WIDTHxHEIGHT"),
        (
            (summer, "--model", model, "--output", "map", "--mean", "1,2"),
            "--mean: expected three numbers with commas",
        ),
        ((summer, "--model", tmp_path / "no.onnx"), "no.onnx', which is no file"),
        ((summer, "--output", "map"), "expected --model too"),
        ((summer, "--cache", "c"), "expected --model too"),
        ((tmp_path / "rows.npy", "--model", model, "--output", "map"), "--model: expected images"),
    )
    for arguments, message in usage:
        said = surefix_("map", "build", *arguments, "-o", out, code=2).stderr
        assert message in " ".join(re.sub(r"[│╭╮╰╯─]", " ", said).split())
    (tmp_path / "bad.onnx").write_text("no model")
    failures = (((summer, "--key", "a"), "--key: expected a file of descriptors"),)
    for arguments, message in failures:
        assert message in surefix_("map", "build", *arguments, "-o", out, code=1).stderr
    assert not out.exists()


def test_ready_descriptors_of_every_kind_are_mapped_and_run(tmp_path: Path) -> None:
    rows = np.random.default_rng(6).standard_normal((12, 9)).astype(np.float32)
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    np.save(tmp_path / "a.npy", rows)
    np.savez(tmp_path / "a.npz", rows)
    save_file({"rows": rows}, tmp_path / "a.safetensors")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["rows"] = rows
    for make, name in ((faiss.IndexFlatIP, "a.faiss"), (faiss.IndexFlatL2, "b.index")):
        index = make(9)
        index.add(rows)
        faiss.write_index(index, str(tmp_path / name))
    for name, metric in (
        ("a.npy", "cosine"),
        ("a.npz", "cosine"),
        ("a.safetensors", "cosine"),
        ("a.h5", "cosine"),
        ("a.faiss", "cosine"),
        ("b.index", "euclidean"),
    ):
        out, fixes = tmp_path / "route.map", tmp_path / "fixes.csv"
        surefix_("map", "build", tmp_path / name, "-o", out)
        route = surefix.Map.open(out)
        assert route.metric == metric
        np.testing.assert_array_equal(route.descriptors, rows)
        surefix_("run", out, tmp_path / name, "-o", fixes)
        with fixes.open(newline="") as lines:
            assert [int(row["place"]) for row in csv.DictReader(lines)] == list(range(12))


def test_one_array_of_several_is_chosen_with_key(tmp_path: Path) -> None:
    rows = np.random.default_rng(6).standard_normal((12, 9)).astype(np.float32)
    np.savez(tmp_path / "a.npz", first=rows, second=rows[::-1])
    out = tmp_path / "route.map"
    surefix_("map", "build", tmp_path / "a.npz", "--key", "second", "-o", out)
    np.testing.assert_array_equal(surefix.Map.open(out).descriptors, rows[::-1])
    said = surefix_("map", "build", tmp_path / "a.npz", "-o", out, code=1).stderr
    assert (
        said
        == f"surefix: {tmp_path / 'a.npz'}: expected a key, as it holds 2 arrays: first, second\n"
    )


def test_the_example_compares_on_any_route(drive: Path) -> None:
    route = Route(places=PLACES, size=(64, 32))
    for name, traverse in (("summer", route.reference()), ("winter", route.revisit())):
        np.save(drive / f"{name}.npy", np.stack([traverse[index] for index in range(PLACES)]))
    example = Path(__file__).resolve().parents[3] / "examples" / "learned.py"
    options = [drive / "tiny.onnx", "--output", "map", "--output", "mean", "--size", "64", "32"]
    drives = ["generated", drive / "summer.npy", drive / "winter.npy"]
    command = [sys.executable, *map(str, [example, *options, *drives])]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    rows = [line.split(" | ") for line in done.stdout.splitlines()]
    assert len(rows) == 2 + 1 + 2 * 4
    assert {len(row) for row in rows[2:]} == {7}
    assert all(0 <= float(row[3]) <= 1 for row in rows[2:])
