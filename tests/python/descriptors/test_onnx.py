"""Networks from ONNX files: the numbers of an oracle, and refusals."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from onnx import TensorProto, helper
from PIL import Image

import real_data
import surefix
import tiny_network
from surefix.descriptors import Descriptor, Onnx, extract

RNG = np.random.default_rng(5)


def images(count: int, shape: tuple[int, ...] = (12, 20, 3)) -> list[Any]:
    return list(RNG.integers(0, 256, (count, *shape), dtype=np.uint8))


@pytest.fixture
def model(tmp_path: Path) -> Path:
    return tiny_network.save(tmp_path / "tiny.onnx")


@pytest.mark.parametrize("shape", [(12, 20, 3), (12, 20), (7, 9, 3), (1, 1)])
def test_it_computes_what_numpy_does(model: Path, shape: tuple[int, ...]) -> None:
    given = images(11, shape)
    network = Onnx(model, output="map", batch=4)
    expected = [tiny_network.feature_map(tiny_network.normalized(image)).ravel() for image in given]
    got = network.describe(given)
    assert got.dtype == np.float32
    np.testing.assert_allclose(got, expected, atol=1e-4)
    np.testing.assert_array_equal(network.describe(given[3]), got[3:4])
    np.testing.assert_array_equal(network.describe(np.stack(given)) if shape[-1] == 3 else got, got)


def test_without_statistics_numbers_go_from_0_to_1(tmp_path: Path) -> None:
    node = helper.make_node("Flatten", ["image"], ["flat"])
    network = Onnx(
        tiny_network.save(tmp_path / "flat.onnx", nodes=[node], outputs=("flat",)),
        mean=None,
        std=None,
    )
    (image,) = images(1)
    np.testing.assert_allclose(
        network.describe(image)[0], image.transpose(2, 0, 1).ravel() / 255, rtol=1e-6
    )


@pytest.mark.parametrize("size", [(8, 6), (40, 3), (20, 12), (1, 1)])
def test_it_resizes_as_pillow_does(tmp_path: Path, size: tuple[int, int]) -> None:
    node = helper.make_node("Flatten", ["image"], ["flat"])
    file = tiny_network.save(tmp_path / "flat.onnx", nodes=[node], outputs=("flat",))
    network = Onnx(file, size=size, mean=None, std=None)
    for image in images(3) + images(3, (12, 20)):
        small = np.asarray(
            Image.fromarray(image).convert("RGB").resize(size, Image.Resampling.BILINEAR)
        )
        np.testing.assert_allclose(
            network.describe(image)[0], small.transpose(2, 0, 1).ravel() / 255, rtol=1e-6
        )


def test_half_precision_runs(tmp_path: Path) -> None:
    file = tiny_network.save(tmp_path / "half.onnx", number=TensorProto.FLOAT16)
    got = Onnx(file, output="mean").describe(images(3))
    assert got.shape == (3, 5)
    assert got.dtype == np.float32


@pytest.mark.parametrize("fixed", [1, 4])
def test_a_model_fixed_to_a_number_of_images_is_filled_up(
    tmp_path: Path, model: Path, fixed: int
) -> None:
    file = tiny_network.save(tmp_path / "fixed.onnx", [fixed, 3, 12, 20])
    network = Onnx(file, output="mean", batch=100)
    assert (network.batch, network.size) == (fixed, (20, 12))
    given = images(7, (30, 30, 3))
    np.testing.assert_allclose(
        network.describe(given),
        Onnx(model, output="mean", size=(20, 12)).describe(given),
        rtol=1e-5,
    )


def test_the_recipe_is_json_and_says_it_all(model: Path) -> None:
    network = Onnx(model, "mean", (16, 8))
    assert isinstance(network, Descriptor)
    assert network.name == "onnx:tiny/mean"
    recipe = json.loads(json.dumps(dict(network.recipe)))
    assert recipe["sha256"] == hashlib.sha256(model.read_bytes()).hexdigest()
    assert (recipe["file"], recipe["output"], recipe["size"]) == ("tiny.onnx", "mean", [16, 8])
    assert (recipe["mean"], recipe["std"]) == (list(tiny_network.MEAN), list(tiny_network.STD))
    rows = extract(images(5), network, batch=2, cache=model.with_name("c"), progress=False)
    assert rows.shape == (5, 5)
    with pytest.raises(
        surefix.SurefixValueError, match=r"got one of onnx:tiny/mean, whose size is \[16, 8\]"
    ):
        extract(images(5), Onnx(model, "mean", (8, 8)), cache=model.with_name("c"), progress=False)


def test_what_is_no_model_is_refused(
    tmp_path: Path, model: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(
        surefix.SurefixFileError, match=r"no\.onnx: cannot read the model: No such file"
    ):
        Onnx(tmp_path / "no.onnx")
    with pytest.raises(surefix.SurefixFileError, match="cannot read the model"):
        Onnx(tmp_path)
    whole = model.read_bytes()
    for content in (b"", b"not a model", whole[: len(whole) // 2]):
        (tmp_path / "bad.onnx").write_bytes(content)
        with pytest.raises(
            surefix.SurefixValueError, match=r"bad\.onnx: not an ONNX model that onnxruntime"
        ):
            Onnx(tmp_path / "bad.onnx")
    assert capfd.readouterr() == ("", "")


def test_options_that_do_not_fit_the_model_are_named(tmp_path: Path, model: Path) -> None:
    cases: list[tuple[Any, str]] = [
        ({}, r"expected output=NAME, as the model has several: map \(.*\), mean \(.*\)"),
        ({"output": "maps"}, r"expected one of the outputs map \(.*\), mean \(.*\), got 'maps'"),
        ({"size": (0, 4)}, r"size: expected \(width, height\) in pixels, got \(0, 4\)"),
        ({"size": 12}, r"size: expected \(width, height\) in pixels, got 12"),
        ({"size": (2.5, 4)}, r"size: expected \(width, height\) in pixels"),
        ({"mean": None}, "mean, std: expected both or neither, got std"),
        ({"mean": (1, 2)}, "mean: expected three numbers"),
        ({"mean": (1, 2, np.nan)}, "mean: expected finite numbers"),
        ({"std": (1, 2, 0)}, "std: expected numbers above 0"),
        ({"batch": 0}, "batch: expected a whole number of at least 1, got 0"),
        (
            {"providers": ["NoExecutionProvider"]},
            "providers: expected some of .*CPUExecutionProvider, got No",
        ),
    ]
    for options, message in cases:
        with pytest.raises(surefix.SurefixValueError, match=message):
            Onnx(model, **options)
    shapes: list[tuple[list[Any], str]] = [
        (
            ["n", 1, 12, 20],
            r"expected an input of RGB images, \(n, 3, H, W\), got image \(n, 1, 12, 20\)",
        ),
        (["n", 12, 20, 3], r"expected an input of RGB images"),
        ([3, 12, 20], r"expected an input of RGB images"),
        ([1, 3, 12, "width"], "expected both sides of the input free or fixed"),
    ]
    node = helper.make_node("Identity", ["image"], ["same"])
    for shape, message in shapes:
        file = tiny_network.save(tmp_path / "other.onnx", shape, [node], ("same",))
        with pytest.raises(surefix.SurefixValueError, match=message):
            Onnx(file)
    fixed = tiny_network.save(tmp_path / "fixed.onnx", [1, 3, 12, 20])
    with pytest.raises(
        surefix.SurefixValueError,
        match=r"expected the size \(20, 12\), which the model is fixed to .*, got \(12, 20\)",
    ):
        Onnx(fixed, "mean", size=(12, 20))
    bytes_in = tiny_network.save(
        tmp_path / "u8.onnx", nodes=[node], outputs=("same",), number=TensorProto.UINT8
    )
    with pytest.raises(
        surefix.SurefixValueError,
        match=r"expected an input of float32 or float16, got tensor\(uint8\)",
    ):
        Onnx(bytes_in)
    both = helper.make_node("Add", ["image", "mask"], ["sum"])
    two = tiny_network.save(
        tmp_path / "two.onnx", nodes=[both], outputs=("sum",), more_inputs=("mask",)
    )
    with pytest.raises(
        surefix.SurefixValueError,
        match=r"expected a model with one input, images, got image .*, mask",
    ):
        Onnx(two)


def test_an_output_that_is_no_vector_an_image_is_refused(tmp_path: Path) -> None:
    def network(node: Any) -> Onnx:
        return Onnx(tiny_network.save(tmp_path / "odd.onnx", nodes=[node], outputs=("out",)))

    over_batch = helper.make_node("ReduceMean", ["image"], ["out"], axes=[0], keepdims=0)
    with pytest.raises(
        surefix.SurefixValueError,
        match=r"output out: expected a vector an image, \(4, ...\) for 4 images",
    ):
        network(over_batch).describe(images(4))
    one_number = helper.make_node("ReduceMean", ["image"], ["out"], axes=[1, 2, 3], keepdims=0)
    with pytest.raises(surefix.SurefixValueError, match=r"got the shape \(4,\)"):
        network(one_number).describe(images(4))
    root = helper.make_node("Sqrt", ["image"], ["out"])
    given = images(6)
    given[4][:] = 0
    for index in (0, 1, 2, 3, 5):
        given[index][:] = 255
    with pytest.raises(
        surefix.SurefixValueError, match=r"output out: expected finite numbers, got nan for image 4"
    ):
        network(root).describe(given)
    with pytest.raises(
        surefix.SurefixValueError, match=r"images 3 to 5: .* for image 1 of the call, at index 0"
    ):
        extract(given, network(root), batch=3, progress=False)


def test_images_that_do_not_fit_are_named(model: Path, tmp_path: Path) -> None:
    network = Onnx(model, "mean")
    with pytest.raises(
        surefix.SurefixValueError,
        match=r"image 1 of the batch: expected 20 x 12 as the first, got 12 x 12",
    ):
        network.describe([*images(1), *images(1, (12, 12, 3))])
    with pytest.raises(
        surefix.SurefixValueError,
        match=r"image 0 of the call: expected uint8 \(H, W\) or \(H, W, 3\), got float64",
    ):
        network.describe([np.zeros((4, 4))])
    with pytest.raises(surefix.SurefixValueError, match="expected at least one, got none"):
        network.describe([])
    shrinking = helper.make_node("AveragePool", ["image"], ["out"], kernel_shape=[16, 16])
    odd = Onnx(tiny_network.save(tmp_path / "odd.onnx", nodes=[shrinking], outputs=("out",)))
    with pytest.raises(surefix.SurefixValueError, match="does not run on 1 images of 20 x 12: "):
        odd.describe(images(1))


def backbone() -> Path:
    file = real_data.folder().parent / "models" / "efficientnet_lite0.onnx"
    if not file.is_file():
        pytest.skip(f"the backbone is missing: no {file}")
    return file


@pytest.mark.slow
def test_a_real_backbone_finds_its_way_through_the_seasons() -> None:
    nordland = real_data.folder() / "nordland"
    network = Onnx(backbone(), output="feat_s16", size=(256, 128))
    rows = []
    for season in ("summer", "winter"):
        images = np.load(nordland / f"{season}_0000_1149.npy")[:300]
        given = extract(images, network, progress=False)
        assert given.shape == (300, 112 * 8 * 16)
        rows.append((given - given.mean(axis=0)) / np.maximum(given.std(axis=0), 1e-6))
    run = surefix.match(surefix.Map.from_descriptors(rows[0], metric="cosine"), rows[1])
    right = np.abs(run.single_place - np.arange(300)) <= 1
    sad = surefix.match(
        surefix.Map.from_images(np.load(nordland / "summer_0000_1149.npy")[:300]),
        np.load(nordland / "winter_0000_1149.npy")[:300],
    )
    by_sad = np.abs(sad.single_place - np.arange(300)) <= 1
    assert right.mean() > 0.65
    assert right.mean() > 1.5 * by_sad.mean()
    assert right[run.trusted].mean() > 0.95
