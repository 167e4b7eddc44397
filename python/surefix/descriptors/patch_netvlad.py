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

from surefix._extra import needed
from surefix.descriptors.reranked import reranked_distances
from surefix.errors import SurefixFileError, SurefixValueError

__all__ = ["PatchNetVlad"]

Rows = npt.NDArray[np.float32]


class PatchNetVlad:
    """Re-ranks the nearest places by their patches, with the package's own matcher, and keeps the
    scores.

    ``patchnetvlad-feature-extract`` writes the features of each drive into a folder. The package's
    own ``patchnetvlad-feature-match`` writes no more than a ranking of them (``read_pairs`` reads
    it); this class calls the same matcher with the same configuration and has the scores behind it.
    Hausler, Garg, Xu, Milford and Fischer, *Patch-NetVLAD*, CVPR 2021.

    Needs PyTorch, OpenCV and ``pip install --no-deps patchnetvlad`` (written for version 0.1.8).

    Parameters ---------- features : str or path The folder of the references: ``globalfeats.npy``
    and ``patchfeats_psize2_NAME.npy`` and so on. references : sequence of str or path The images in
    route order, as in the list that the features were made from. config : str or path One of the
    package's configurations, ``"performance"``, ``"speed"`` or ``"storage"``, or an ``.ini`` file:
    that which the features were made with. candidates : int, optional Places a query that are
    looked at; the greatest of ``n_values_all`` by default. device : str normalised : bool True is
    the published score: of each patch size, less its mean over the candidates and divided by their
    spread, and their weighted sum. False is the weighted sum itself, from -1 (all patches agree) to
    0 with RANSAC: the better one to put a threshold on, as it means the same for every query.

    Raises
    ------
    SurefixFileError
        Where a file is missing.
    SurefixValueError
        Where the features are not those of these references, or the configuration lacks something.
    SurefixError
        Where a package is missing.

    Examples
    --------
    >>> from surefix.descriptors import PatchNetVlad
    >>> network = PatchNetVlad("features/summer", summer_images, config="speed")                # doctest: +SKIP
    >>> matcher = surefix.Matcher(places=len(summer_images))                                    # doctest: +SKIP
    >>> for distances in network.columns("features/winter", winter_images):                     # doctest: +SKIP
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
        self._torch = needed("torch", what, "PyTorch", "torch")
        local = needed("patchnetvlad.models.local_matcher", what, "patchnetvlad", install)
        patches = needed("patchnetvlad.tools.patch_matcher", what, "patchnetvlad", install)
        self.folder, self.device, self.normalised = Path(features), device, normalised
        settings = _Settings(
            config,
            needed("patchnetvlad.tools", what, "patchnetvlad", install).PATCHNETVLAD_ROOT_DIR,
        )
        self._sizes, self._weights = settings.patch_sizes, np.array(settings.weights)
        with warnings.catch_warnings():
            # The package is older than PyTorch's wish to be told the order of a grid's axes.
            warnings.simplefilter("ignore")
            spots = [
                local.calc_keypoint_centers_from_patches(
                    settings.matching, size, size, stride, stride
                )
                for size, stride in zip(settings.patch_sizes, settings.strides, strict=True)
            ]
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
            raise SurefixValueError(f"candidates: expected at least 1, got {candidates}")

    def columns(
        self, features: str | PathLike[str], queries: Sequence[str | PathLike[str]]
    ) -> Iterator[npt.NDArray[np.float32]]:
        """For each query, the distances of all places, (n,): what ``Matcher.push`` takes.

        Raises
        ------
        SurefixError
            As for the references' features.
        """
        folder, names = Path(features), [_stem(name) for name in queries]
        of_queries = _global_features(folder, len(names))
        if of_queries.shape[1] != self._global.shape[1]:
            raise SurefixValueError(
                f"{folder}: expected global features of {self._global.shape[1]} numbers as of the references, "
                f"got {of_queries.shape[1]}"
            )
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
            found[row], _, _ = self._matcher.match(
                theirs, self._patches(self.folder, self._names[place])
            )
        if self.normalised:
            spread = found.std(axis=0)
            # Where all candidates agree, the package divides 0 by 0; such a patch size says
            # nothing.
            found = (found - found.mean(axis=0)) / np.where(spread > 0, spread, 1)
        total: npt.NDArray[np.float64] = found @ self._weights
        return total

    def _patches(self, folder: Path, name: str) -> list[Any]:
        loaded = [_load(folder / f"patchfeats_psize{size}_{name}.npy") for size in self._sizes]
        return [self._torch.tensor(array, device=self.device) for array in loaded]


class _Settings:
    """What the matching takes of the package's configuration."""

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
            self.weights = [
                float(weight) for weight in self.matching["patchWeights2Use"].split(",")
            ]
            self.candidates = max(int(count) for count in self.matching["n_values_all"].split(","))
        except OSError as error:
            raise SurefixFileError(
                f"{path}: cannot read the configuration: {error.strerror or error}"
            ) from None
        except (configparser.Error, KeyError, ValueError) as error:
            said = str(error).split("\n")[0]
            raise SurefixValueError(
                f"{path}: expected a configuration of Patch-NetVLAD's matching: {said}"
            ) from None
        if not len(self.patch_sizes) == len(self.strides) == len(self.weights):
            raise SurefixValueError(
                f"{path}: expected as many patch_sizes, strides and patchWeights2Use, got {len(self.patch_sizes)}, "
                f"{len(self.strides)} and {len(self.weights)}"
            )


def _global_features(folder: Path, images: int) -> Rows:
    array = _load(folder / "globalfeats.npy")
    if array.ndim != 2 or len(array) != images:
        raise SurefixValueError(
            f"{folder / 'globalfeats.npy'}: expected a row for each of the {images} images, got the shape {array.shape}"
        )
    return array.astype(np.float32, copy=False)


def _load(path: Path) -> npt.NDArray[Any]:
    try:
        array: npt.NDArray[Any] = np.load(path, allow_pickle=False)
    except OSError as error:
        raise SurefixFileError(
            f"{path}: cannot read the features: {error.strerror or error}"
        ) from None
    except (ValueError, EOFError) as error:
        raise SurefixValueError(f"{path}: not a .npy array, or a truncated one ({error})") from None
    return array


def _stem(name: str | PathLike[str]) -> str:
    """What the package names an image's features after."""
    return os.path.splitext(os.path.basename(os.fspath(name)))[0]
