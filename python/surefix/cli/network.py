"""A map whose images a network describes: ``surefix map build --model``."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import typer

from surefix import Map, SurefixValueError
from surefix.descriptors import Onnx
from surefix.descriptors.mapping import map_of_images
from surefix.descriptors.network_input import IMAGENET_MEAN, IMAGENET_STD
from surefix.post import Normalize, Pca, RandomProjection, Standardize, Step

__all__ = ["map_of_network", "network_of", "no_model", "open_network", "steps_of"]


def open_network(
    model: Path,
    output: str | None,
    size: tuple[int, int] | None,
    mean: str | None,
    std: str | None,
    batch: int,
) -> Onnx:
    """The network of the options; ``mean`` and ``std`` are three numbers with commas, or "none"."""
    try:
        return Onnx(
            model,
            output,
            size,
            IMAGENET_MEAN if mean is None else _three("--mean", mean),
            IMAGENET_STD if std is None else _three("--std", std),
            batch,
        )
    except SurefixValueError as error:
        # An output or a size that the model does not have is a mistake of the command line's.
        raise typer.BadParameter(str(error)) from None


def map_of_network(
    images: Sequence[str] | npt.NDArray[np.uint8],
    network: Onnx,
    metric: str,
    positions: npt.NDArray[np.float64] | None,
    cache: Path | None,
    post: list[Step] | None = None,
) -> Map:
    """The map of a drive's images, described by the network, with their files' names and the
    network's recipe.
    """
    return map_of_images(images, network, metric, positions, post, cache)


def network_of(known: Map, route: object, model: Path) -> Onnx:
    """The network that made a map, by the recipe in it and the model's file; ``route`` is what the
    map is called.

    Raises
    ------
    BadParameter
        Where the map was made by something else than this network.
    """
    recipe = known.recipe
    if recipe is None:
        raise typer.BadParameter(
            f"--model: expected a map made with one, got {route}, which names none"
        )
    wanted = ("output", "size", "mean", "std")
    if not str(recipe.get("name", "")).startswith("onnx:") or not all(
        key in recipe for key in wanted
    ):
        raise typer.BadParameter(
            f"--model: expected a map made with one, got a map by {recipe.get('name')!r}"
        )
    size, mean, std = (None if recipe[key] is None else tuple(recipe[key]) for key in wanted[1:])
    network = Onnx(model, recipe["output"], size, mean, std)
    if network.recipe["sha256"] != recipe.get("sha256"):
        raise typer.BadParameter(
            f"--model: expected {recipe['file']} as it was when the map was made, got another model"
        )
    return network


def no_model(name: str, route: object) -> typer.BadParameter:
    """The refusal of images for a network's map, where the network is not given."""
    return typer.BadParameter(
        f"expected --model with {name}, which {route} was made with, got none"
    )


def steps_of(text: str) -> list[Step]:
    """The steps of ``--post``: names with commas, such as ``standardize,pca:512,normalize``."""
    steps: list[Step] = []
    for part in text.split(","):
        name, _, number = part.strip().partition(":")
        count = int(number) if number.isdecimal() else 0
        if (name, number) == ("standardize", ""):
            steps.append(Standardize())
        elif (name, number) == ("standardize", "running"):
            steps.append(Standardize("running"))
        elif (name, number) == ("normalize", ""):
            steps.append(Normalize())
        elif name == "pca" and count:
            steps.append(Pca(count))
        elif name == "projection" and count:
            steps.append(RandomProjection(count))
        else:
            expected = (
                "standardize, standardize:running, pca:N, projection:N and normalize, with commas"
            )
            raise typer.BadParameter(f"--post: expected {expected}, got {part!r}")
    return steps


def _three(option: str, text: str) -> tuple[float, ...] | None:
    if text == "none":
        return None
    try:
        values = tuple(float(value) for value in text.split(","))
    except ValueError:
        values = ()
    if len(values) != 3:
        raise typer.BadParameter(
            f'{option}: expected three numbers with commas, or "none", got {text!r}'
        )
    return values
