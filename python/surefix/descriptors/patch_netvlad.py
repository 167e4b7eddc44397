"""Patch-NetVLAD by its authors' package: its features in, distances of all places out."""

import configparser
import os
import warnings
from collections.abc import Iterator, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix._extra import require
from surefix.descriptors.reranked import reranked_distances
from surefix.errors import SurefixValueError, mismatch, refusal
from surefix.tables.npy import read_npy

Rows = npt.NDArray[np.float32]


class PatchNetVlad:
    """Re-ranks the nearest places by their patches, by the package's own matcher and scores.

    ``patchnetvlad-feature-extract`` writes the features of each drive into a folder. The package's
    own ``patchnetvlad-feature-match`` writes only a ranking of them (``read_pairs`` reads it); this
    class calls the same matcher with the same configuration and keeps its scores. Hausler, Garg,
    Xu, Milford and Fischer, *Patch-NetVLAD*, CVPR 2021.

    Needs PyTorch, OpenCV and ``pip install --no-deps patchnetvlad`` (written for version 0.1.8).

    Parameters
    ----------
    features : str or path
        The folder of the references: ``globalfeats.npy`` and ``patchfeats_psize2_NAME.npy`` and so
        on.
    references : sequence of str or path
        The images in route order, as in the list that the features were made from.
    config : str or path
        One of the package's configurations, ``"performance"``, ``"speed"`` or ``"storage"``, or an
        ``.ini`` file: that which the features were made with.
    candidates : int, optional
        Places re-ranked a query; the greatest of ``n_values_all`` by default.
    device : str
    normalised : bool
        True is the published score: that of each patch size, less its mean over the candidates and
        divided by their spread, in a weighted sum. False is the weighted sum itself, from -1 (all
        patches agree) to 0 with RANSAC: the better one for a threshold, as it means the same for
        every query.

    Raises
    ------
    SurefixFileError
        If a file is missing.
    SurefixValueError
        If the features are not those of these references, or the configuration lacks something.
    SurefixError
        If a package is missing.

    Examples
    --------
    >>> from surefix.descriptors import PatchNetVlad
    >>> network = PatchNetVlad("features/summer", summer_images, config="speed")   # doctest: +SKIP
    >>> matcher = surefix.Matcher(places=len(summer_images))   # doctest: +SKIP
    >>> for distances in network.columns("features/winter", winter_images):   # doctest: +SKIP
    ...     fix = matcher.push(distances)
    """

    def __init__(
        self,
        features: str | PathLike[str],
        references: Sequence[str | PathLike[str]],
        config: str | PathLike[str] = "performance",
        candidates: int | None = None,
        device: str = "cpu",
        normalised: bool = True,
    ) -> None:
        what, install = "Patch-NetVLAD", "patchnetvlad"
        self._torch = require("torch", what, "PyTorch", "torch")
        local = require("patchnetvlad.models.local_matcher", what, "patchnetvlad", install)
        patches = require("patchnetvlad.tools.patch_matcher", what, "patchnetvlad", install)
        tools = require("patchnetvlad.tools", what, "patchnetvlad", install)
        self.folder, self.device, self.normalised = Path(features), device, normalised
        settings = _Settings(config, tools.PATCHNETVLAD_ROOT_DIR)
        scales = list(zip(settings.patch_sizes, settings.strides, strict=True))
        self._sizes, self._weights = settings.patch_sizes, np.array(settings.weights)
        with warnings.catch_warnings():
            # PyTorch warns of the package's grids without an order of axes.
            warnings.simplefilter("ignore")
            centres = local.calc_keypoint_centers_from_patches
            spots = [centres(settings.matching, n, n, step, step) for n, step in scales]
        self._matcher = patches.PatchMatcher(
            settings.matcher,
            settings.patch_sizes,
            settings.strides,
            [spot[0] for spot in spots],
            [spot[1] for spot in spots],
        )
        self._names = [_stem(name) for name in references]
        self._global = _global_features(self.folder, len(self._names))
        self.candidates = min(candidates or settings.candidates, len(self._names))
        if self.candidates < 1:
            raise mismatch("candidates", "at least 1", candidates)

    def columns(
        self, features: str | PathLike[str], queries: Sequence[str | PathLike[str]]
    ) -> Iterator[npt.NDArray[np.float32]]:
        """For each query, the distances of all places, (n,), as ``Matcher.push`` takes them.

        Raises
        ------
        SurefixError
            As for the references' features.
        """
        folder, names = Path(features), [_stem(name) for name in queries]
        of_queries = _global_features(folder, len(names))
        if of_queries.shape[1] != self._global.shape[1]:
            expected = f"global features of {self._global.shape[1]} numbers as of the references"
            raise mismatch(folder, expected, of_queries.shape[1])
        for name, feature in zip(names, of_queries, strict=True):
            coarse = np.linalg.norm(self._global - feature, axis=1)
            nearest = np.argsort(coarse, kind="stable")[: self.candidates]
            yield reranked_distances(coarse, nearest, self.scores(folder, name, nearest))

    def scores(
        self, features: Path, query: str, candidates: npt.NDArray[np.int64]
    ) -> npt.NDArray[np.float64]:
        """The scores of some places for one query, smaller is better."""
        theirs = [tensor.T for tensor in self._patches(features, query)]
        found = np.empty((len(candidates), len(self._sizes)))
        for row, place in enumerate(candidates):
            ours = self._patches(self.folder, self._names[place])
            found[row], _, _ = self._matcher.match(theirs, ours)
        if self.normalised:
            spread = found.std(axis=0)
            # If all candidates agree, the package divides 0 by 0; such a patch size is left out.
            found = (found - found.mean(axis=0)) / np.where(spread > 0, spread, 1)
        total: npt.NDArray[np.float64] = found @ self._weights
        return total

    def _patches(self, folder: Path, name: str) -> list[Any]:
        files = [folder / f"patchfeats_psize{size}_{name}.npy" for size in self._sizes]
        loaded = [read_npy(file, "the features") for file in files]
        return [self._torch.tensor(array, device=self.device) for array in loaded]


class _Settings:
    """The part of the package's configuration that the matching uses."""

    def __init__(self, config: str | PathLike[str], package: str) -> None:
        given = Path(config)
        path = given if given.suffix else Path(package, "configs", f"{given}.ini")
        parser = configparser.ConfigParser()
        try:
            with path.open(encoding="utf-8") as file:
                parser.read_file(file)
            self.matching = parser["feature_match"]
            shape = parser["global_params"]
            self.matcher = self.matching["matcher"]
            self.patch_sizes = [int(size) for size in shape["patch_sizes"].split(",")]
            self.strides = [int(stride) for stride in shape["strides"].split(",")]
            weights = self.matching["patchWeights2Use"]
            self.weights = [float(weight) for weight in weights.split(",")]
            self.candidates = max(int(count) for count in self.matching["n_values_all"].split(","))
        except OSError as error:
            raise refusal(path, "cannot read the configuration", error) from None
        except (configparser.Error, KeyError, ValueError) as error:
            said = str(error).split("\n")[0]
            expected = "expected a configuration of Patch-NetVLAD's matching"
            raise SurefixValueError(f"{path}: {expected}: {said}") from None
        if not len(self.patch_sizes) == len(self.strides) == len(self.weights):
            expected = "patch_sizes, strides and patchWeights2Use of one length"
            got = f"{len(self.patch_sizes)}, {len(self.strides)} and {len(self.weights)}"
            raise mismatch(path, expected, got)


def _global_features(folder: Path, images: int) -> Rows:
    file = folder / "globalfeats.npy"
    array = read_npy(file, "the features")
    if array.ndim != 2 or len(array) != images:
        raise mismatch(file, f"a row for each of the {images} images", f"the shape {array.shape}")
    return array.astype(np.float32, copy=False)


def _stem(name: str | PathLike[str]) -> str:
    """The part of an image's name in its features' names."""
    return os.path.splitext(os.path.basename(os.fspath(name)))[0]
