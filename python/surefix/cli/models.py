"""``surefix models``: the networks that ``--model`` knows by name, and what is here of them."""

import json
import os
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from surefix._terminal import Console, say
from surefix.cli.flags import documented
from surefix.cli.info import WIDE
from surefix.descriptors import HUB_MODELS
from surefix.descriptors.hub import HubModel
from surefix.descriptors.known import caches, noted

BRANCHES = ("main", "master")


@documented
def models(as_json: Annotated[bool, typer.Option("--json")] = False) -> None:
    """List the networks that --model knows by name: descriptors, licences, packages, and where
    their code and weights lie on this machine.

    Parameters
    ----------
    as_json: One JSON object instead of a table, with papers, addresses and notes.
    """
    found = [facts_of(name, model) for name, model in HUB_MODELS.items()]
    known = noted().items()
    files = [{"sha256": sum_, "file": str(path)} for sum_, path in known if path.is_file()]
    if as_json:
        say(json.dumps({"models": found, "files": files}))
        return
    table = Table(box=None, pad_edge=False)
    for heading in ("name", "dim", "images", "licence", "to install", "here"):
        # A name that is to be typed must not be cut.
        table.add_column(heading, overflow="fold")
    for each in found:
        width, height = each["size"]
        lacking = [package for package, there in each["packages"].items() if not there]
        packages = ", ".join(lacking) or "none"
        row = (str(each["dim"]), f"{width} x {height}", each["licence"], packages, _said(each))
        table.add_row(each["name"], *row)
    width = None if sys.stdout.isatty() else WIDE
    console = Console(width=width)
    console.print(table)
    lines = [
        "",
        f"Code and weights come by torch.hub at the first use, into {hub_folder()}; the licence is "
        "that of the code.",
        "Any ONNX file of images is a model too: --model FILE.",
    ]
    if files:
        lines.append(f"Files that were used here: {', '.join(each['file'] for each in files)}")
    for line in lines:
        console.print(line, soft_wrap=width is not None)


def facts_of(name: str, model: HubModel) -> dict[str, Any]:
    """All that ``--json`` says of a model."""
    folder = hub_folder()
    code = [folder / f"{model.repository.replace('/', '_')}_{branch}" for branch in BRANCHES]
    weights = [folder / "checkpoints" / file for file in model.weights]
    published = _hugging_face() / f"models--{model.published.replace('/', '--')}" / "snapshots"
    kept = sorted(published.glob("*/*.safetensors")) if model.published else []
    return {
        "name": name,
        "dim": model.dim,
        "size": list(model.size),
        "licence": model.licence,
        "paper": model.paper,
        "repository": f"https://github.com/{model.repository}",
        "packages": {package: find_spec(package) is not None for package in model.packages},
        "code": next((str(path) for path in code if path.is_dir()), None),
        "weights": [str(path) for path in (*weights, *kept) if path.is_file()],
        "note": model.note,
    }


def hub_folder() -> Path:
    """The folder of torch.hub, without importing PyTorch."""
    home = os.environ.get("TORCH_HOME")
    return (Path(home).expanduser() if home else caches() / "torch") / "hub"


def _hugging_face() -> Path:
    """The folder of models from Hugging Face."""
    for variable, inside in (("HF_HUB_CACHE", ""), ("HF_HOME", "hub")):
        if folder := os.environ.get(variable):
            return Path(folder).expanduser() / inside
    return caches() / "huggingface" / "hub"


def _said(facts: dict[str, Any]) -> str:
    """What is here of a model, in words."""
    weights = ", ".join(facts["weights"])
    if facts["code"] is None:
        return f"only weights: {weights}" if weights else "not found"
    return f"code and {weights}" if weights else f"only code: {facts['code']}"
