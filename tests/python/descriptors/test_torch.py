"""PyTorch modules, and the published models' loading; skipped if PyTorch is not installed."""

import json
import socket
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import surefix
import tiny_network
from surefix.descriptors import HUB_MODELS, Descriptor, Torch, extract, from_hub
from surefix.descriptors.descriptor import same_vectors

torch = pytest.importorskip("torch")
RNG = np.random.default_rng(8)


def images(count: int, shape: tuple[int, ...] = (12, 20, 3)) -> list[Any]:
    return list(RNG.integers(0, 256, (count, *shape), dtype=np.uint8))


def tiny() -> Any:
    """The network that tiny_network's oracle computes."""
    conv = torch.nn.Conv2d(3, 5, 3, stride=2, padding=1)
    with torch.no_grad():
        conv.weight.copy_(torch.from_numpy(tiny_network.KERNEL))
        conv.bias.copy_(torch.from_numpy(tiny_network.BIAS))
    return torch.nn.Sequential(conv, torch.nn.ReLU())


class Calls(torch.nn.Module):  # type: ignore[misc]
    """Gives back its input, and remembers its calls."""

    def __init__(self, answer: Any = lambda planes: planes) -> None:
        super().__init__()
        self.dropout = torch.nn.Dropout(0.5)
        self.frozen = torch.nn.Dropout(0.5).eval()
        self.answer = answer
        self.seen: list[Any] = []
        self.states: list[Any] = []

    def forward(self, planes: Any) -> Any:
        self.seen.append(planes)
        self.states.append(
            (self.training, self.dropout.training, torch.is_inference_mode_enabled())
        )
        return self.answer(self.dropout(planes))


@pytest.mark.parametrize("shape", [(12, 20, 3), (12, 20), (7, 9, 3)])
def test_it_computes_what_numpy_does(shape: tuple[int, ...]) -> None:
    given = images(11, shape)
    network = Torch(tiny(), batch=4)
    assert isinstance(network, Descriptor)
    expected = [tiny_network.feature_map(tiny_network.normalized(image)).ravel() for image in given]
    np.testing.assert_allclose(network.describe(given), expected, atol=1e-4)
    # PyTorch adds up in another order for another number of images.
    np.testing.assert_allclose(network.describe(given[3])[0], network.describe(given)[3], atol=1e-5)
    np.testing.assert_array_equal(extract(given, network, progress=False), network.describe(given))


def test_it_runs_in_evaluation_and_leaves_each_part_as_it_was() -> None:
    module = Calls()
    module.train()
    module.frozen.eval()
    Torch(module, batch=2).describe(images(5))
    assert [len(planes) for planes in module.seen] == [2, 2, 1]
    assert set(module.states) == {(False, False, True)}
    assert (module.training, module.dropout.training, module.frozen.training) == (True, True, False)

    def fail(planes: Any) -> Any:
        raise RuntimeError("out of memory\nand more")

    module.answer = fail
    with pytest.raises(
        surefix.SurefixValueError,
        match=r"does not run on images of the shape \(1, 3, 12, 20\): out of m",
    ):
        Torch(module, name="mine").describe(images(1))
    assert (module.training, module.dropout.training, module.frozen.training) == (True, True, False)


def test_on_the_cpu_nothing_is_copied(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []
    module = Calls()
    network = Torch(module)
    batch = network._input.batch
    monkeypatch.setattr(
        network._input, "batch", lambda images: made.append(batch(images)) or made[-1]
    )
    rows = network.describe(images(3))
    assert module.seen[0].data_ptr() == made[0].ctypes.data
    assert rows.ctypes.data == made[0].ctypes.data


def test_a_transform_gets_a_pillow_image_in_colour() -> None:
    def transform(image: Image.Image) -> Any:
        assert isinstance(image, Image.Image)
        small = np.asarray(image.resize((8, 4), Image.Resampling.BICUBIC))
        return torch.from_numpy(small.transpose(2, 0, 1).astype(np.float32))

    given = images(3, (12, 20))
    rows = Torch(torch.nn.Identity(), transform).describe(given)
    own = Torch(torch.nn.Identity(), size=(8, 4), mean=None, std=None, resample="bicubic").describe(
        given
    )
    np.testing.assert_allclose(own * 255, rows, atol=1e-4)
    with pytest.raises(
        surefix.SurefixValueError, match=r"transform: expected tensors of one shape, .* got ndarray"
    ):
        Torch(torch.nn.Identity(), np.asarray).describe(given)


def test_autocast_computes_in_half_and_gives_float32() -> None:
    given = images(4)
    half = Torch(tiny(), autocast=torch.bfloat16).describe(given)
    full = Torch(tiny()).describe(given)
    assert half.dtype == np.float32
    assert 0 < np.abs(half - full).max() < 0.2


def test_the_recipe_is_json_and_tells_weights_apart() -> None:
    first, same, other = Torch(tiny(), size=(8, 4)), Torch(tiny(), size=(8, 4)), tiny()
    assert json.loads(json.dumps(dict(first.recipe))) == first.recipe == same.recipe
    with torch.no_grad():
        other[0].bias[3] += 1e-6
    assert Torch(other, size=(8, 4)).recipe["weights_sha256"] != first.recipe["weights_sha256"]
    half = Torch(tiny().to(torch.bfloat16), size=(8, 4)).recipe["weights_sha256"]
    assert half != first.recipe["weights_sha256"]


def test_what_does_not_fit_is_named() -> None:
    cases: list[tuple[Any, str]] = [
        (lambda: Torch(lambda planes: planes), "module: expected a torch.nn.Module, got function"),
        (lambda: Torch(tiny(), batch=0), "batch: expected a whole number"),
        (lambda: Torch(tiny(), device="nowhere"), "device: "),
        (lambda: Torch(tiny(), print, size=(8, 4)), "transform: expected something to call"),
        (
            lambda: Torch(Calls(lambda planes: (planes,))).describe(images(2)),
            "gives a tensor, .* got tuple",
        ),
        (
            lambda: Torch(Calls(lambda planes: planes.mean(0))).describe(images(2)),
            r"got the shape \(3, 12, 20\)",
        ),
        (
            lambda: Torch(Calls(lambda planes: planes.flatten())).describe(images(1)),
            r"got the shape \(720,\)",
        ),
        (
            lambda: Torch(Calls(lambda planes: planes / 0 * 0)).describe(images(1)),
            "expected finite numbers, got nan",
        ),
        (lambda: Torch(tiny()).describe([]), "expected at least one, got none"),
        (lambda: from_hub("resnet"), "expected one of netvlad, cosplace, .*, anyloc, got 'resnet'"),
    ]
    for call, message in cases:
        with pytest.raises(surefix.SurefixValueError, match=message):
            call()


@pytest.fixture
def offline(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Path]:
    """A hub folder of its own, and a proxy that does not listen."""
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        port = closed.getsockname()[1]
    for variable in ("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"):
        monkeypatch.setenv(variable, f"http://127.0.0.1:{port}")
    for variable in ("no_proxy", "NO_PROXY"):
        monkeypatch.delenv(variable, raising=False)
    modules = set(sys.modules)
    # What `torch.hub.set_dir` sets; it cannot be unset by it.
    monkeypatch.setattr(torch.hub, "_hub_dir", str(tmp_path / "hub"))
    yield tmp_path / "hub"
    for name in set(sys.modules) - modules:
        if name in ("hubconf", "backbone_code"):
            del sys.modules[name]


@pytest.mark.parametrize("name", HUB_MODELS)
def test_offline_the_error_says_what_to_fetch_and_where_to_put_it(name: str, offline: Path) -> None:
    model = HUB_MODELS[name]
    with pytest.raises(surefix.SurefixError) as caught:
        from_hub(name)
    said = str(caught.value)
    assert "\n" not in said
    assert said.startswith(
        f"{name}: cannot load {model.entry} of https://github.com/{model.repository}"
    )
    assert f"torch.hub.load({model.repository!r}, {model.entry!r}" in said
    assert said.endswith(f"copy its torch.hub.get_dir() to {offline}")


@pytest.mark.parametrize("name", HUB_MODELS)
def test_offline_a_model_in_the_hubs_folder_is_loaded(name: str, offline: Path) -> None:
    model = HUB_MODELS[name]
    folder = offline / (model.repository.replace("/", "_") + "_main")
    folder.mkdir(parents=True)
    # The hub's own layout, with a network that leaves its input as it is and remembers its
    # arguments.
    (folder / "hubconf.py").write_text(
        "import torch\n"
        f"def {model.entry}(**options):\n"
        "    module = torch.nn.Identity()\n"
        "    module.options = options\n"
        "    return module\n"
    )
    network = from_hub(name, extra=3)
    assert network.module.options == {**model.options, "extra": 3}
    assert network.name == f"hub:{name},extra=3"
    assert network.recipe["repository"] == model.repository
    (image,) = images(1, (model.size[1], model.size[0], 3))
    planes = network.describe(image).reshape(3, model.size[1], model.size[0])
    expected = (image.transpose(2, 0, 1) / 255 - np.reshape(model.mean, (3, 1, 1))) / np.reshape(
        model.std, (3, 1, 1)
    )
    np.testing.assert_allclose(planes, expected, rtol=1e-4, atol=1e-4)
    if model.size[0] == 322:
        assert model.size[0] % 14 == model.size[1] % 14 == 0
    small = from_hub(name, size=(28, 14))
    assert small.describe(image).shape == (1, 3 * 28 * 14)


# A published model as torch.hub keeps it: a linear layer on the means of the channels, its weights
# from the release of its own repository, and its backbone's from another.
PUBLISHED = """
import torch
import backbone_code

print("Returning the trained model")

def get_trained_model(scale=1):
    model = backbone_code.Means(scale)
    model.load_state_dict(
        torch.hub.load_state_dict_from_url(
            "https://github.com/gmberton/MegaLoc/releases/download/v1.0/megaloc.torch",
            map_location=torch.device("cpu"),
        )
    )
    return model
"""
BACKBONE = """
import torch

class Means(torch.nn.Module):
    def __init__(self, scale):
        super().__init__()
        self.scale, self.linear = scale, torch.nn.Linear(3, 4)

    def forward(self, planes):
        return self.scale * self.linear(planes.mean(dim=(2, 3)))
"""


def publish(folder: Path, code: str = PUBLISHED) -> Path:
    """The code of ``megaloc`` in a hub's folder."""
    made = folder / "gmberton_MegaLoc_main"
    made.mkdir(parents=True)
    (made / "hubconf.py").write_text(code)
    (made / "backbone_code.py").write_text(BACKBONE)
    return made


def weights_file(path: Path, seed: int) -> tuple[Path, Any]:
    """A state of that model in a file, and its matrix."""
    torch.manual_seed(seed)
    state = torch.nn.Linear(3, 4).state_dict()
    torch.save({f"linear.{name}": value for name, value in state.items()}, path)
    return path, state["weight"].numpy()


def test_offline_weights_come_from_a_file(
    offline: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    publish(offline)
    with pytest.raises(surefix.SurefixError, match="megaloc: cannot load get_trained_model"):
        from_hub("megaloc")
    first, matrix = weights_file(tmp_path / "mine.pth", 1)
    usual = torch.hub.load_state_dict_from_url
    network = from_hub("megaloc", weights=first)
    assert torch.hub.load_state_dict_from_url is usual
    np.testing.assert_array_equal(network.module.linear.weight.detach().numpy(), matrix)
    # What the code prints is no fix.
    said = capsys.readouterr()
    assert (said.out, "Returning the trained model" in said.err) == ("", True)
    recipe = network.recipe
    assert json.loads(json.dumps(dict(recipe))) == recipe
    kept: Any = recipe["weights"]
    assert (kept["file"], len(kept["sha256"])) == ("mine.pth", 64)
    # The file that weights came from makes no other descriptor; other weights do.
    copy = tmp_path / "copy.pth"
    copy.write_bytes(first.read_bytes())
    assert same_vectors(recipe, from_hub("megaloc", weights=copy).recipe)
    other, _ = weights_file(tmp_path / "other.pth", 2)
    assert not same_vectors(recipe, from_hub("megaloc", weights=other).recipe)


def test_weights_are_given_to_the_models_own_download_alone(offline: Path, tmp_path: Path) -> None:
    code = PUBLISHED.replace("gmberton/MegaLoc/releases", "facebookresearch/dinov2/releases")
    publish(offline, code)
    file, _ = weights_file(tmp_path / "mine.pth", 1)
    # Another repository's weights are still downloaded, which fails without a network.
    with pytest.raises(surefix.SurefixError, match="megaloc: cannot load get_trained_model"):
        from_hub("megaloc", weights=file)
    # By its published name it is known, whatever the address.
    named = tmp_path / "megaloc.torch"
    named.write_bytes(file.read_bytes())
    assert from_hub("megaloc", weights=named).module.linear.weight.shape == (4, 3)
    code = "import torch\ndef get_trained_model():\n    return torch.nn.Identity()\n"
    (offline / "gmberton_MegaLoc_main" / "hubconf.py").write_text(code)
    with pytest.raises(surefix.SurefixValueError, match="got a file that it did not ask for"):
        from_hub("megaloc", weights=file)


def test_weights_from_hugging_face_come_from_a_file(
    offline: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = (
        "import torch, backbone_code\n"
        "def get_trained_model(scale=1):\n"
        "    from huggingface_hub import hf_hub_download\n"
        "    from safetensors.torch import load_file\n"
        "    model = backbone_code.Means(scale)\n"
        "    file = hf_hub_download(repo_id='gberton/MegaLoc', filename='model.safetensors')\n"
        "    model.load_state_dict(load_file(file))\n"
        "    return model\n"
    )
    publish(offline, code)

    def refuse(**_: Any) -> None:
        raise OSError("no network")

    library = type(sys)("huggingface_hub")
    library.hf_hub_download = refuse  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "huggingface_hub", library)
    _, matrix = weights_file(tmp_path / "mine.pth", 3)
    kept = pytest.importorskip("safetensors.torch")
    file = tmp_path / "any.safetensors"
    kept.save_file(torch.load(tmp_path / "mine.pth"), file)
    network = from_hub("megaloc", weights=file)
    np.testing.assert_array_equal(network.module.linear.weight.detach().numpy(), matrix)
    with pytest.raises(surefix.SurefixError, match="no network"):
        from_hub("megaloc")


def test_a_file_of_other_weights_is_refused(offline: Path, tmp_path: Path) -> None:
    publish(offline)
    text, other = tmp_path / "text.pth", tmp_path / "other.pth"
    text.write_text("no weights")
    torch.save(torch.nn.Linear(2, 2).state_dict(), other)
    with pytest.raises(
        surefix.SurefixFileError, match=r"none\.pth: cannot read the model: No such"
    ):
        from_hub("megaloc", weights=tmp_path / "none.pth")
    with pytest.raises(surefix.SurefixError, match=r"^.*text\.pth: not the weights of a model: "):
        from_hub("megaloc", weights=text)
    with pytest.raises(
        surefix.SurefixValueError, match=r"other\.pth: not the weights of megaloc: .*Missing key"
    ):
        from_hub("megaloc", weights=other)
