"""Learned descriptors: a network, or files of ready vectors, in place of plain image differences.

>>> from surefix.descriptors import Onnx, extract   # doctest: +SKIP
>>> network = Onnx("backbone.onnx", output="embedding", size=(256, 128))   # doctest: +SKIP
>>> rows = extract("photos/monday", network, cache="monday.cache")   # doctest: +SKIP
>>> route = surefix.Map.from_descriptors(rows, metric="cosine")   # doctest: +SKIP

``Descriptor`` is their protocol. ``Verifier`` is that of a second look at the nearest places, which
a ``Reranker`` takes: ``XFeat``, ``PatchNetVlad``. ``Onnx`` and ``XFeat`` need ``pip install
"surefix[learned]"``, ``Torch`` and ``from_hub`` ``"surefix[torch]"``, ``load`` the package of the
file's format. Each is imported when it is used.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from surefix.descriptors.descriptor import Descriptor
    from surefix.descriptors.extraction import extract
    from surefix.descriptors.hub import HUB_MODELS, from_hub
    from surefix.descriptors.onnx import Onnx
    from surefix.descriptors.patch_netvlad import PatchNetVlad
    from surefix.descriptors.reranked import read_pairs, reranked_distances
    from surefix.descriptors.reranker import Reranker
    from surefix.descriptors.torch import Torch
    from surefix.descriptors.verifier import Verifier
    from surefix.descriptors.xfeat import XFeat
    from surefix.tables.vectors import load, metric_of

__all__ = [
    "HUB_MODELS",
    "Descriptor",
    "Onnx",
    "PatchNetVlad",
    "Reranker",
    "Torch",
    "Verifier",
    "XFeat",
    "extract",
    "from_hub",
    "load",
    "metric_of",
    "read_pairs",
    "reranked_distances",
]

_MODULES = {
    "surefix.descriptors.descriptor": ("Descriptor",),
    "surefix.descriptors.extraction": ("extract",),
    "surefix.descriptors.hub": ("HUB_MODELS", "from_hub"),
    "surefix.descriptors.onnx": ("Onnx",),
    "surefix.descriptors.patch_netvlad": ("PatchNetVlad",),
    "surefix.descriptors.reranked": ("read_pairs", "reranked_distances"),
    "surefix.descriptors.reranker": ("Reranker",),
    "surefix.descriptors.torch": ("Torch",),
    "surefix.descriptors.verifier": ("Verifier",),
    "surefix.descriptors.xfeat": ("XFeat",),
    "surefix.tables.vectors": ("load", "metric_of"),
}


def __getattr__(name: str) -> object:
    for module, names in _MODULES.items():
        if name in names:
            return getattr(import_module(module), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
