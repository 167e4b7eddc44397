"""The network that describes images: of ``--model``, or the one that a map was made with."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import typer

from surefix import Map, SurefixError, SurefixValueError
from surefix.cli.inputs import refuse
from surefix.descriptors import HUB_MODELS, Onnx, Torch, from_hub
from surefix.descriptors.descriptor import recipe_of, same_vectors
from surefix.descriptors.known import find, note
from surefix.descriptors.network_input import IMAGENET_MEAN, IMAGENET_STD

Network: TypeAlias = Onnx | Torch

Model = Annotated[
    str | None,
    typer.Option(
        metavar="NAME|FILE",
        help="Describe the images by this network: an ONNX file, or a model of `surefix models` by "
        "its name. By default the one that the map was made with.",
    ),
]
Weights = Annotated[
    Path | None,
    typer.Option(
        help="A model of `surefix models`: its weights in this file, in place of their download."
    ),
]
Output = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="--model FILE: which of its outputs, if it has several."),
]
# The names of the networks that were made of a file, and by name.
ONNX, HUB = "onnx:", "hub:"


@dataclass(frozen=True)
class ModelOptions:
    """The options ``--model``, ``--weights`` and ``--output`` as they are typed."""

    model: str | None = None
    weights: Path | None = None
    output: str | None = None

    @property
    def files(self) -> list[Path]:
        """The files that are read."""
        return [Path(each) for each in (self.model, self.weights) if each is not None]


def open_network(
    wanted: ModelOptions,
    size: tuple[int, int] | None = None,
    mean: str | None = None,
    std: str | None = None,
    batch: int | None = None,
) -> Network | None:
    """The network of the options, if one is named; ``mean`` and ``std`` are three numbers with
    commas, or "none".
    """
    model, weights, output = wanted.model, wanted.weights, wanted.output
    if model is None:
        refuse(weights is not None, "--weights: expected --model too, got none")
        expected = "--output: expected --model too, whose output it names, got none"
        refuse(output is not None, f"{expected}; -o names a file to write")
        return None
    if Path(model).is_file():
        refuse(weights is not None, f"--weights: expected a name as --model, got the file {model}")
        means = IMAGENET_MEAN if mean is None else _three("--mean", mean)
        spreads = IMAGENET_STD if std is None else _three("--std", std)
        try:
            return _noted(Onnx(model, output, size, means, spreads, batch or 8))
        except SurefixValueError as error:
            # An output or a size that the model does not have is a mistake of the command line's.
            said = str(error).replace("output=NAME", "--output NAME")
            raise typer.BadParameter(said) from None
    name = _name_of(model)
    options = {"--output": output, "--mean": mean, "--std": std}
    given = ", ".join(option for option, value in options.items() if value is not None)
    refuse(bool(given), f"{given}: expected an ONNX file as --model, got the name {name}")
    return _from_hub(name, weights, size=size, batch=batch or 8)


def network_of(
    known: Map, route: str, wanted: ModelOptions, beside: Sequence[Path] = ()
) -> Network | None:
    """The network that made a map, whose file is ``route``; None if that was none, or one that
    neither a file nor a name can be given for. An ONNX file that is not named is looked for beside
    the map, in the folders ``beside``, and where it was used last.
    """
    recipe = {key: value for key, value in (known.recipe or {}).items() if key != "levels"}
    name = str(recipe.get("name", ""))
    of_file = name.startswith(ONNX) and {"output", "size", "mean", "std", "sha256"} <= set(recipe)
    of_hub = name.startswith(HUB) and {"options", "size"} <= set(recipe)
    if not (of_file or of_hub):
        got = f"a map by {name!r}" if name else f"{route}, which names none"
        given = (wanted.model, wanted.output) != (None, None)
        refuse(given, f"--model: expected a map made with one, got {got}")
        return None
    places = [Path(route).absolute().parent, *beside]
    if of_file:
        return _of_file(recipe, route, wanted, places)
    return _of_hub(recipe, route, wanted, places)


def _of_file(
    recipe: dict[str, Any], route: str, wanted: ModelOptions, folders: Sequence[Path]
) -> Network:
    """The network of an ONNX file."""
    file, sum_ = str(recipe.get("file", "")), str(recipe["sha256"])
    expected = f"the ONNX file {file}, which {route} was made with"
    refuse(wanted.weights is not None, f"--weights: expected none, as {route} is by {file}")
    if wanted.model is None:
        found = find(sum_, file, folders)
        if found is None:
            lies = "it lies neither beside the map nor where it was used last"
            changed = [each / file for each in folders if (each / file).is_file()]
            lies = f"{changed[0]} is another model" if changed else lies
            raise typer.BadParameter(f"expected {expected}; {lies}: add --model FILE")
    else:
        found = Path(wanted.model)
        name = wanted.model.removeprefix(HUB)
        named = name in HUB_MODELS and not found.is_file()
        refuse(named, f"--model: expected {expected}, got the model {name}")
    numbers = (recipe[key] for key in ("size", "mean", "std"))
    size, mean, std = (None if value is None else tuple(value) for value in numbers)
    network = Onnx(found, recipe["output"], size, mean, std)
    other = network.recipe["sha256"] != sum_
    expected = f"--model: expected {file} as it was when {route} was made"
    refuse(other, f"{expected}, got another model")
    kept, wished = recipe["output"], wanted.output
    expected = f"--output: expected {kept}, which {route} was made with"
    refuse(wished not in (None, kept), f"{expected}, got {wished}")
    return _noted(network)


def _of_hub(
    recipe: dict[str, Any], route: str, wanted: ModelOptions, folders: Sequence[Path]
) -> Network:
    """The network of a name; its weights too are looked for, if they were those of a file."""
    name = str(recipe["name"]).removeprefix(HUB).split(",")[0]
    expected = f"--model: expected {name}, which {route} was made with"
    if wanted.model is not None:
        refuse(Path(wanted.model).is_file(), f"{expected}, got the file {wanted.model}")
        refuse(_name_of(wanted.model) != name, f"{expected}, got {wanted.model}")
    refuse(name not in HUB_MODELS, f"{route} was made with the model {name}, which is not known")
    weights, kept = wanted.weights, recipe.get("weights")
    if weights is None and kept is not None:
        weights = find(str(kept.get("sha256")), str(kept.get("file", "")), folders)
    usual = HUB_MODELS[name].options
    options = {key: value for key, value in recipe["options"].items() if usual.get(key) != value}
    size = None if recipe["size"] is None else tuple(recipe["size"])
    try:
        network = _from_hub(name, weights, size=size, **options)
    except SurefixError as error:
        if weights is not None or kept is None:
            raise
        lies = f"{kept.get('file')}, its weights when {route} was made, lie neither beside the map "
        lies += "nor where they were used last: add --weights FILE"
        raise SurefixError(f"{lies} ({error})") from None
    if not same_vectors(recipe, recipe_of(network)):
        got = "other weights" if _weights_of(recipe) != _weights_of(network.recipe) else "others"
        raise SurefixValueError(f"{route}: expected {name} as it was when it was made, got {got}")
    return network


def _weights_of(recipe: Any) -> object:
    return recipe.get("weights_sha256")


def _name_of(model: str) -> str:
    """The name of a published model."""
    name = model.removeprefix(HUB)
    expected = f"--model: expected an ONNX file, or one of {', '.join(HUB_MODELS)}"
    refuse(name not in HUB_MODELS, f"{expected}; got {model!r}, which is no file")
    return name


def _from_hub(name: str, weights: Path | None, **how: Any) -> Network:
    """The model of a name, on the graphics card if there is one."""
    network = from_hub(name, weights=weights, device=_device(), **how)
    kept: Any = network.recipe.get("weights")
    if weights is not None and kept is not None:
        note(str(kept["sha256"]), weights)
    return network


def _device() -> str | None:
    try:
        import torch
    except ImportError:
        # The model says what is missing.
        return None
    return "cuda" if torch.cuda.is_available() else None


def _noted(network: Onnx) -> Onnx:
    note(str(network.recipe["sha256"]), network.path)
    return network


def _three(option: str, text: str) -> tuple[float, ...] | None:
    if text == "none":
        return None
    try:
        red, green, blue = (float(value) for value in text.split(","))
    except ValueError:
        expected = 'three numbers with commas, or "none"'
        raise typer.BadParameter(f"{option}: expected {expected}, got {text!r}") from None
    return red, green, blue
