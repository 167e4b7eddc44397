"""Models by their names on the command line, and ``surefix models``: with a network that the tests
publish in a folder of torch.hub; skipped if PyTorch is not installed.
"""

import csv
import json
import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import commands
import surefix
import tiny_network
from surefix.descriptors import HUB_MODELS
from surefix.simulate import Route

surefix_ = partial(commands.surefix_, COLUMNS="400")
PLACES = 30
# A network by the name of megaloc: the means of 8 x 8 fields in three channels, a weight each.
CODE = """
import torch

dependencies = ["torch"]

class Fields(torch.nn.Module):
    def __init__(self):
        super().__init__()
        self.weight = torch.nn.Parameter(torch.zeros(3))

    def forward(self, planes):
        fields = torch.nn.functional.adaptive_avg_pool2d(planes, (8, 8))
        return fields * self.weight[:, None, None]

def get_trained_model():
    print("Returning the trained model")
    model = Fields()
    model.load_state_dict(
        torch.hub.load_state_dict_from_url(
            "https://github.com/gmberton/MegaLoc/releases/download/v1.0/megaloc.torch"
        )
    )
    return model
"""


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drives")
    route = Route(places=PLACES, size=(64, 32))
    for name, drive in (("monday", route.reference()), ("tuesday", route.revisit())):
        (folder / name).mkdir()
        for index in range(PLACES):
            Image.fromarray(drive[index]).save(folder / name / f"{index:03}.png")
    tiny_network.save(folder / "tiny.onnx", outputs=("map",))
    return folder


@pytest.fixture
def here(drives: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with both drives, and a hub's folder and a cache of its own."""
    for name in ("monday", "tuesday"):
        (tmp_path / name).symlink_to(drives / name)
    shutil.copy(drives / "tiny.onnx", tmp_path)
    for variable in ("TORCH_HOME", "SUREFIX_CACHE", "HF_HOME"):
        monkeypatch.setenv(variable, str(tmp_path / variable.lower()))
    monkeypatch.delenv("HF_HUB_CACHE", raising=False)
    # A proxy that does not listen: there is no network.
    for variable in ("http_proxy", "https_proxy"):
        monkeypatch.setenv(variable, "http://127.0.0.1:9")
        monkeypatch.setenv(variable.upper(), "http://127.0.0.1:9")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def publish(here: Path) -> Path:
    """The code in the hub's folder; the weights in a file beside the drives."""
    torch = pytest.importorskip("torch")
    folder = here / "torch_home" / "hub" / "gmberton_MegaLoc_main"
    folder.mkdir(parents=True)
    (folder / "hubconf.py").write_text(CODE)
    file = here / "mine.pth"
    torch.save({"weight": torch.tensor([1.0, 2.0, 3.0])}, file)
    return file


def places(text: str) -> list[str]:
    return [row["place"] for row in csv.DictReader(text.splitlines())]


def test_two_folders_and_a_models_name(here: Path) -> None:
    weights = publish(here)
    named = ("--model", "megaloc", "--weights", weights)
    done = surefix_("run", "monday", "tuesday", *named, "--save-map", "m.safetensors")
    assert "monday: a map of 30 places, kept in m.safetensors\n" in done.stderr
    # The code's own words are no fixes.
    assert "Returning the trained model" in done.stderr
    found = places(done.stdout)
    assert len(found) == PLACES
    route = surefix.Map.open("m.safetensors")
    assert route.recipe is not None
    assert (route.recipe["name"], route.dim) == ("hub:megaloc", 3 * 64)
    # The map says which model it is of: run and the others find it, and its weights, again.
    assert places(surefix_("run", "m.safetensors", "tuesday").stdout) == found
    assert places(surefix_("run", "m.safetensors", "tuesday", *named[:2]).stdout) == found
    surefix_("align", "m.safetensors", "tuesday", "-o", "truth.csv")
    surefix_("map", "append", "m.safetensors", "tuesday")
    assert len(surefix.Map.open("m.safetensors")) == 2 * PLACES
    closed = surefix_("loops", "tuesday", *named)
    assert "30 frames" in closed.stderr
    # Beside the map they are found, too.
    (here / "robot").mkdir()
    shutil.move("m.safetensors", here / "robot")
    shutil.move(weights, here / "robot")
    assert len(places(surefix_("run", "robot/m.safetensors", "tuesday").stdout)) == PLACES
    shutil.move(here / "robot" / "mine.pth", here / "elsewhere.pth")
    said = surefix_("run", "robot/m.safetensors", "tuesday", code=1).stderr
    assert "mine.pth, its weights when robot/m.safetensors was made, lie neither beside" in said
    assert "add --weights FILE" in said
    surefix_("run", "robot/m.safetensors", "tuesday", "--weights", "elsewhere.pth")


def test_other_weights_are_not_the_maps(here: Path) -> None:
    torch = pytest.importorskip("torch")
    weights = publish(here)
    surefix_("map", "build", "monday", "--model", "megaloc", "--weights", weights)
    torch.save({"weight": torch.tensor([1.0, 2.0, 4.0])}, "other.pth")
    said = surefix_("run", "route.safetensors", "tuesday", "--weights", "other.pth", code=1).stderr
    assert "expected megaloc as it was when it was made, got other weights" in said
    usage = (
        (("--model", "salad"), "expected megaloc, which route.safetensors was made with, got sal"),
        (("--model", "tiny.onnx"), "made with, got the file tiny.onnx"),
        (("--model", "megalok"), "got 'megalok', which is no file"),
    )
    for options, message in usage:
        assert message in surefix_("run", "route.safetensors", "tuesday", *options, code=2).stderr
    surefix_("map", "build", "monday", "--model", "tiny.onnx", "-o", "onnx.safetensors")
    said = surefix_("run", "onnx.safetensors", "tuesday", "--model", "megaloc", code=2).stderr
    assert "expected the ONNX file tiny.onnx" in said
    options = ("--model", "megaloc", "--output", "map", "--mean", "none")
    said = surefix_("map", "build", "monday", *options, code=2).stderr
    assert "--output, --mean: expected an ONNX file as --model, got the name megaloc" in said


def test_models_lists_all_that_is_known_and_here(here: Path) -> None:
    facts = json.loads(surefix_("models", "--json").stdout)
    assert [each["name"] for each in facts["models"]] == list(HUB_MODELS)
    assert facts["files"] == []
    assert all(each["code"] is None and each["weights"] == [] for each in facts["models"])
    hub = here / "torch_home" / "hub"
    (hub / "gmberton_MegaLoc_main").mkdir(parents=True)
    kept = here / "hf_home" / "hub" / "models--gberton--MegaLoc" / "snapshots" / "abc"
    kept.mkdir(parents=True)
    (kept / "model.safetensors").write_bytes(b"")
    (hub / "checkpoints").mkdir()
    (hub / "checkpoints" / "dino_salad.ckpt").write_bytes(b"")
    surefix_("map", "build", "monday", "--model", "tiny.onnx")
    facts = json.loads(surefix_("models", "--json").stdout)
    found = {each["name"]: each for each in facts["models"]}
    assert found["megaloc"]["code"] == str(hub / "gmberton_MegaLoc_main")
    assert found["megaloc"]["weights"] == [str(kept / "model.safetensors")]
    assert (found["megaloc"]["dim"], found["megaloc"]["licence"]) == (8448, "MIT")
    assert found["salad"]["weights"] == [str(hub / "checkpoints" / "dino_salad.ckpt")]
    assert found["salad"]["code"] is None
    assert [each["file"] for each in facts["files"]] == [str(here / "tiny.onnx")]
    said = surefix_("models").stdout
    lines = {line.split()[0]: line for line in said.splitlines() if line.strip()}
    assert "code and " in lines["megaloc"]
    assert "only weights: " in lines["salad"]
    assert lines["netvlad"].rstrip().endswith("not found")
    assert "Files that were used here: " in said


def test_an_onnx_file_is_found_again(here: Path) -> None:
    surefix_("map", "build", "monday", "--model", "tiny.onnx")
    first = places(surefix_("run", "route.safetensors", "tuesday").stdout)
    assert len(first) == PLACES
    # The map is the same file wherever the model lies.
    before = Path("route.safetensors").read_bytes()
    Path("models").mkdir()
    shutil.move("tiny.onnx", "models/tiny.onnx")
    said = surefix_("run", "route.safetensors", "tuesday", code=2).stderr
    assert (
        "expected the ONNX file tiny.onnx, which route.safetensors was made with; it lies" in said
    )
    surefix_("map", "build", "monday", "--model", "models/tiny.onnx")
    assert Path("route.safetensors").read_bytes() == before
    assert places(surefix_("run", "route.safetensors", "tuesday").stdout) == first
    # Another file under its name is not taken for it.
    with Path("models/tiny.onnx").open("ab") as file:
        file.write(b"\0")
    shutil.copy("models/tiny.onnx", "tiny.onnx")
    said = surefix_("run", "route.safetensors", "tuesday", code=2).stderr
    assert "tiny.onnx is another model: add --model FILE" in said
    # Ready descriptors take no model.
    np.save("rows.npy", surefix.Map.open("route.safetensors").descriptors)
    assert places(surefix_("run", "route.safetensors", "rows.npy").stdout) == [
        str(index) for index in range(PLACES)
    ]


def test_a_cache_that_cannot_be_written_is_no_mistake(
    here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (here / "file").write_text("{")
    monkeypatch.setenv("SUREFIX_CACHE", str(here / "file"))
    surefix_("map", "build", "monday", "--model", "tiny.onnx")
    assert len(places(surefix_("run", "route.safetensors", "tuesday").stdout)) == PLACES
    monkeypatch.setenv("SUREFIX_CACHE", str(here / "folder"))
    (here / "folder").mkdir()
    (here / "folder" / "models.json").write_text("{ no list")
    assert surefix_("models").returncode == 0
    surefix_("run", "route.safetensors", "tuesday")
    assert json.loads((here / "folder" / "models.json").read_text())


def test_without_pytorch_a_name_says_what_to_install(here: Path) -> None:
    try:
        import torch  # noqa: F401
    except ImportError:
        said = surefix_("run", "monday", "tuesday", "--model", "megaloc", code=1).stderr
        assert "the model megaloc takes PyTorch, which is not installed: pip install" in said
    else:
        pytest.skip("PyTorch is installed")
