"""Learned descriptors: a network, or files of ready vectors, in place of plain image differences.

>>> from surefix.descriptors import Onnx, extract                                               # doctest: +SKIP
>>> network = Onnx("backbone.onnx", output="embedding", size=(256, 128))                        # doctest: +SKIP
>>> rows = extract("photos/monday", network, cache="monday.cache")                              # doctest: +SKIP
>>> route = surefix.Map.from_descriptors(rows, metric="cosine")                                 # doctest: +SKIP

``Descriptor`` is all that surefix asks of one. ``Onnx`` needs ``pip install "surefix[learned]"``,
``Torch`` and ``from_hub`` need PyTorch, ``load`` what the file's format takes. Nothing of it is
imported before it is used.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from surefix.descriptors.descriptor import Descriptor
    from surefix.descriptors.extraction import extract
    from surefix.descriptors.hub import HUB_MODELS, from_hub
    from surefix.descriptors.onnx import Onnx
    from surefix.descriptors.patch_netvlad import PatchNetVlad
    from surefix.descriptors.ready import load, metric_of
    from surefix.descriptors.reranked import read_pairs, reranked_distances
    from surefix.descriptors.torch import Torch

__all__ = [
    "HUB_MODELS",
    "Descriptor",
    "Onnx",
    "PatchNetVlad",
    "Torch",
    "extract",
    "from_hub",
    "load",
    "metric_of",
    "read_pairs",
    "reranked_distances",
]

_HOMES = {
    "HUB_MODELS": "hub",
    "Descriptor": "descriptor",
    "Onnx": "onnx",
    "PatchNetVlad": "patch_netvlad",
    "Torch": "torch",
    "extract": "extraction",
    "from_hub": "hub",
    "load": "ready",
    "metric_of": "ready",
    "read_pairs": "reranked",
    "reranked_distances": "reranked",
}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found: object = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
