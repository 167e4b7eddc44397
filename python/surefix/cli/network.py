"""A map whose images a network describes: ``surefix map build --model``."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import typer

from surefix import Map, SurefixValueError
from surefix.descriptors import Onnx, extract
from surefix.descriptors.network_input import IMAGENET_MEAN, IMAGENET_STD

__all__ = ["map_of_network", "open_network"]


def open_network(
    model: Path, output: str | None, size: tuple[int, int] | None, mean: str | None, std: str | None, batch: int
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
) -> Map:
    """The map of a drive's images, described by the network, with their files' names."""
    rows = extract(images, network, cache=cache)
    names = None if isinstance(images, np.ndarray) else [Path(image).name for image in images]
    return Map.from_descriptors(rows, metric, positions=positions, names=names)


def _three(option: str, text: str) -> tuple[float, ...] | None:
    if text == "none":
        return None
    try:
        values = tuple(float(value) for value in text.split(","))
    except ValueError:
        values = ()
    if len(values) != 3:
        raise typer.BadParameter(f'{option}: expected three numbers with commas, or "none", got {text!r}')
    return values
