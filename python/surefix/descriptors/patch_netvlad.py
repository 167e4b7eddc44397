"""Patch-NetVLAD by its authors' package, as a verifier."""

import configparser
import warnings
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix._extra import require
from surefix.errors import SurefixError, SurefixValueError, mismatch
from surefix.tables.npy import read_npy
from surefix.tables.rows import read_text


class PatchNetVlad:
    """Patch-NetVLAD's patches, compared by the package's own matcher and scores, as a ``Verifier``.

    ``patchnetvlad-feature-extract`` writes the features of each drive into a folder. The package's
    own ``patchnetvlad-feature-match`` writes only a ranking of them (``read_pairs`` reads it); this
    class calls the same matcher with the same configuration and keeps its scores. Hausler, Garg,
    Xu, Milford and Fischer, *Patch-NetVLAD*, CVPR 2021.

    Needs PyTorch, OpenCV and ``pip install --no-deps patchnetvlad`` (written for version 0.1.8).

    Parameters
    ----------
    config : str or path
        One of the package's configurations, ``"performance"``, ``"speed"`` or ``"storage"``, or an
        ``.ini`` file: that which the features were made with.
    device : str
    normalised : bool
        True is the published score: that of each patch size, less its mean over the candidates and
        divided by their spread, in a weighted sum. False is the weighted sum itself, from -1 (all
        patches agree) to 0 with RANSAC: the better one for a threshold, as it means the same for
        every query.

    Raises
    ------
    SurefixFileError
        If the configuration cannot be read.
    SurefixValueError
        If the configuration lacks something.
    SurefixError
        If a package is missing.

    Examples
    --------
    The global features are a map's rows; ``summer_images`` are names such as ``summer/0.png``.

    >>> from surefix.descriptors import PatchNetVlad, Reranker
    >>> rows, seen = (np.load(f"{d}/globalfeats.npy") for d in drives)   # doctest: +SKIP
    >>> route = surefix.Map.from_descriptors(rows, metric="euclidean")   # doctest: +SKIP
    >>> reranker = Reranker(PatchNetVlad("speed"), summer_images)   # doctest: +SKIP
    >>> reranked = reranker.distances(route.distances(seen[0]), "winter/0.png")   # doctest: +SKIP
    """

    def __init__(
        self,
        config: str | PathLike[str] = "performance",
        device: str = "cpu",
        normalised: bool = True,
    ) -> None:
        what, install = "Patch-NetVLAD", "patchnetvlad"
        self._torch = require("torch", what, "PyTorch", "surefix[torch]")
        local = require("patchnetvlad.models.local_matcher", what, "patchnetvlad", install)
        patches = require("patchnetvlad.tools.patch_matcher", what, "patchnetvlad", install)
        tools = require("patchnetvlad.tools", what, "patchnetvlad", install)
        self.device, self.normalised = device, normalised
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

    def features(self, image: str | PathLike[str]) -> list[Path]:
        """The files of an image's features, ``patchfeats_psize2_NAME.npy`` and so on, of
        ``FOLDER/NAME`` with any ending. They are read when they are compared.
        """
        folder, name = Path(image).parent, Path(image).stem
        return [folder / f"patchfeats_psize{size}_{name}.npy" for size in self._sizes]

    def scores(
        self, query: Sequence[Path], places: Sequence[Sequence[Path]]
    ) -> npt.NDArray[np.float64]:
        """The scores of some places for one query, smaller is better.

        Raises
        ------
        SurefixFileError
            If a file of features cannot be read.
        """
        theirs = [tensor.T for tensor in self._read(query)]
        found = np.empty((len(places), len(self._sizes)))
        for row, place in enumerate(places):
            found[row], _, _ = self._matcher.match(theirs, self._read(place))
        if self.normalised:
            spread = found.std(axis=0)
            # If all candidates agree, the package divides 0 by 0; such a patch size is left out.
            found = (found - found.mean(axis=0)) / np.where(spread > 0, spread, 1)
        total: npt.NDArray[np.float64] = found @ self._weights
        return total

    def _read(self, files: Sequence[Path]) -> list[Any]:
        loaded = [read_npy(file, "the features") for file in files]
        return [self._torch.tensor(array, device=self.device) for array in loaded]


class _Settings:
    """The part of the package's configuration that the matching uses."""

    def __init__(self, config: str | PathLike[str], package: str) -> None:
        given = Path(config)
        path = given if given.suffix else Path(package, "configs", f"{given}.ini")
        parser = configparser.ConfigParser()
        try:
            parser.read_string(read_text(path, "the configuration"))
            self.matching = parser["feature_match"]
            shape = parser["global_params"]
            self.matcher = self.matching["matcher"]
            self.patch_sizes = [int(size) for size in shape["patch_sizes"].split(",")]
            self.strides = [int(stride) for stride in shape["strides"].split(",")]
            weights = self.matching["patchWeights2Use"]
            self.weights = [float(weight) for weight in weights.split(",")]
        except (configparser.Error, KeyError, ValueError) as error:
            if isinstance(error, SurefixError):
                raise
            said = str(error).split("\n")[0]
            expected = "expected a configuration of Patch-NetVLAD's matching"
            raise SurefixValueError(f"{path}: {expected}: {said}") from None
        if not len(self.patch_sizes) == len(self.strides) == len(self.weights):
            expected = "patch_sizes, strides and patchWeights2Use of one length"
            got = f"{len(self.patch_sizes)}, {len(self.strides)} and {len(self.weights)}"
            raise mismatch(path, expected, got)
