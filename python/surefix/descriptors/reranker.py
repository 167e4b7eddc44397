"""A second look at the nearest places: a verifier's scores, as the distances of all places."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from surefix._core import Map
from surefix._extra import require
from surefix._progress import Bar, Progress, terminal_bar
from surefix._saving import save
from surefix.descriptors.reranked import reranked_distances
from surefix.descriptors.verifier import Verifier, require_verifier
from surefix.errors import SurefixValueError, check_folder, mismatch, refusal
from surefix.frames.images import frames_of
from surefix.tables.regular import check_regular

CANDIDATES = 10
KEPT = "a file of local features, by Reranker.save"
# The pairs of rows of a map that tell it from another.
SAMPLED = 64


class Reranker:
    """Re-ranks the nearest places of each query by a verifier.

    Its distances go into a ``Matcher``, ``match_distances``, ``align`` and ``audit`` like those of
    any technique. It has no state: a query that is refused changes nothing.

    Parameters
    ----------
    verifier : Verifier
    references
        An image of each place, in the map's order: a folder or a pattern, or any images that
        ``Map.from_images`` takes. A list's items go to ``verifier.features`` as they are.
    candidates : int
        The nearest places, which are verified for each query; all of them if there are fewer.
    progress : callable, optional
        Called as ``progress(done, total)`` after each place. None is a bar on a terminal, False is
        nothing.

    Raises
    ------
    SurefixValueError
        If a verifier's member is missing, there is no reference, or an image is refused.
    SurefixFileError
        If an image cannot be read.

    Examples
    --------
    >>> import numpy as np, surefix
    >>> from surefix.descriptors import Reranker
    >>> class Rows:
    ...     def features(self, image):
    ...         return image.mean(axis=1)
    ...     def scores(self, query, places):
    ...         return [np.abs(query - place).mean() for place in places]
    >>> images = np.random.default_rng(0).integers(0, 255, (6, 48, 96), np.uint8)
    >>> reranker = Reranker(Rows(), images, candidates=3, progress=False)
    >>> reranker.distances([0.5, 0.4, 0.3, 0.6, 0.7, 0.8], images[1]).argmin()
    np.int64(1)
    """

    def __init__(
        self,
        verifier: Verifier,
        references: Any,
        candidates: int = CANDIDATES,
        progress: Progress | Literal[False] | None = None,
    ) -> None:
        report = terminal_bar("Local features") if progress is None else progress or None
        checked = require_verifier(verifier)
        images, count = _items(references)
        bar = Bar(report, count, None)
        features: list[Any] = []
        for image in images:
            try:
                features.append(checked.features(image))
            except SurefixValueError as error:
                raise SurefixValueError(f"reference {len(features)}: {error}") from None
            bar.show(len(features))
        bar.end(len(features))
        self._set(checked, features, candidates)

    def _set(self, verifier: Verifier, features: list[Any], candidates: int) -> None:
        if not features:
            raise mismatch("references", "at least one", "none")
        if not isinstance(candidates, int) or candidates < 1:
            raise mismatch("candidates", "a whole number of at least 1", repr(candidates))
        self.verifier, self.candidates = verifier, min(candidates, len(features))
        self._features = features

    def __len__(self) -> int:
        """The number of places."""
        return len(self._features)

    def distances(
        self,
        global_distances: npt.ArrayLike,
        images: Any,
        progress: Progress | Literal[False] | None = None,
    ) -> npt.NDArray[np.float32]:
        """The distances of all places after a second look at the nearest, by
        ``reranked_distances``.

        Parameters
        ----------
        global_distances : array, shape (n,) or (n, m)
            From one query, or from each of ``m``, to every place, by a first, fast descriptor:
            ``Map.distances``, ``Localizer.distances``, or those of any technique.
        images
            The query's image, or the ``m`` queries' as for ``references``.
        progress : callable, optional
            As for the references, after each query.

        Returns
        -------
        array of float32, of the shape of ``global_distances``

        Raises
        ------
        SurefixValueError
            For another number of places or images, a number that is not finite, or an image that
            the verifier refuses.
        """
        coarse = np.asarray(global_distances)
        if coarse.ndim not in (1, 2) or len(coarse) != len(self):
            expected = f"({len(self)},) or ({len(self)}, m), as there are features of {len(self)}"
            raise mismatch("global_distances", f"{expected} places", coarse.shape)
        if coarse.ndim == 1:
            return self._column(coarse, images)
        report = terminal_bar("Re-ranking") if progress is None else progress or None
        bar = Bar(report, coarse.shape[1], None)
        result = np.empty(coarse.shape, np.float32)
        done = 0
        for image in _items(images)[0]:
            if done == coarse.shape[1]:
                raise mismatch("images", f"{done}, one a column of distances", "more")
            try:
                result[:, done] = self._column(coarse[:, done], image)
            except SurefixValueError as error:
                raise SurefixValueError(f"query {done}: {error}") from None
            done += 1
            bar.show(done)
        if done != coarse.shape[1]:
            raise mismatch("images", f"{coarse.shape[1]}, one a column of distances", done)
        return result

    def _column(self, coarse: npt.NDArray[Any], image: Any) -> npt.NDArray[np.float32]:
        nearest = np.argsort(coarse, kind="stable")[: self.candidates]
        query = self.verifier.features(image)
        scores = self.verifier.scores(query, [self._features[place] for place in nearest])
        return reranked_distances(coarse, nearest, scores)

    def save(self, path: str | PathLike[str], route: Map) -> None:
        """Keeps the references' features in a file beside the map ``route``.

        A safetensors file: the features one after the other, and the number of rows of each.

        Raises
        ------
        SurefixValueError
            If the map has another number of places, or the verifier has no recipe, or its features
            are not arrays that agree but in their length.
        SurefixFileError
            If the file cannot be written.
        SurefixError
            If safetensors is missing: ``pip install "surefix[learned]"``.
        """
        library = _safetensors("numpy")
        file = Path(path)
        check_folder(file, "cannot write the features")
        of = _of(self.verifier, route, len(self))
        arrays = [np.atleast_1d(np.asarray(features)) for features in self._features]
        kinds = sorted(
            {f"{array.dtype} (k{''.join(f', {n}' for n in array.shape[1:])})" for array in arrays}
        )
        if len(kinds) > 1 or arrays[0].dtype.kind not in "fiu":
            raise mismatch("the features", "number arrays, of one type", " and ".join(kinds))
        counts = np.array([len(array) for array in arrays], np.int64)
        tensors = {"features": np.concatenate(arrays), "counts": counts}
        save(file, library.save(tensors, metadata=of), "cannot write the features")

    @classmethod
    def open(
        cls,
        path: str | PathLike[str],
        verifier: Verifier,
        route: Map,
        candidates: int = CANDIDATES,
    ) -> "Reranker":
        """The re-ranker of features that ``save`` kept for this map and this verifier.

        Raises
        ------
        SurefixValueError
            If the file is no such file, or one of another map or verifier.
        SurefixFileError
            If it cannot be read.
        SurefixError
            If safetensors is missing.
        """
        library = _safetensors("")
        expected = _of(verifier, route, len(route))
        check_regular(path, "cannot read the features")
        try:
            with library.safe_open(path, framework="np") as file:
                _check_of(path, expected, file.metadata() or {})
                features, counts = file.get_tensor("features"), file.get_tensor("counts")
        except OSError as error:
            raise refusal(path, "cannot read the features", error) from None
        except library.SafetensorError as error:
            raise mismatch(path, KEPT, f"another or a damaged one ({error})") from None
        except (TypeError, AttributeError) as error:
            # NumPy has no bfloat16, for one.
            raise mismatch(path, "features of NumPy's types", error) from None
        whole = counts.shape == (len(route),) and counts.dtype == np.int64 and (counts >= 0).all()
        # In Python's numbers, which cannot overflow.
        if not whole or (sum(counts.tolist()),) != features.shape[:1]:
            raise mismatch(path, f"features of {len(route)} places", "a damaged file")
        made = cls.__new__(cls)
        made._set(
            require_verifier(verifier), np.split(features, np.cumsum(counts[:-1])), candidates
        )
        return made


def _items(images: Any) -> tuple[Iterable[Any], int | None]:
    """A folder's or a data set's images, read, or the items of a list as they are; their number."""
    if isinstance(images, (list, tuple)):
        return images, len(images)
    frames = frames_of(images)
    return (shot.read() for shot in frames.shots()), frames.count


def _of(verifier: Verifier, route: Map, places: int) -> dict[str, str]:
    """All that features are of, as they are told from others'."""
    if len(route) != places:
        raise mismatch("the map", f"{places} places, as there are features", len(route))
    recipe: Mapping[str, object] | None = getattr(verifier, "recipe", None)
    if recipe is None:
        got = f"{type(verifier).__name__} without one"
        raise mismatch("verifier", "a recipe, by which its features are known", got)
    state = hashlib.sha256()
    for row in np.linspace(0, places - 2, SAMPLED).astype(int).tolist():
        state.update(route.slice(row, row + 2).descriptors.tobytes())
    known = {"places": str(places), "verifier": json.dumps(dict(recipe), sort_keys=True)}
    return {**known, "map": state.hexdigest()}


def _check_of(
    path: str | PathLike[str], ours: Mapping[str, str], theirs: Mapping[str, str]
) -> None:
    if not theirs.keys() >= ours.keys():
        raise mismatch(path, KEPT, "another safetensors file")
    if ours["places"] != theirs["places"]:
        raise mismatch(path, f"features of {ours['places']} places", theirs["places"])
    if ours["verifier"] != theirs["verifier"]:
        raise mismatch(path, f"features by {ours['verifier']}", theirs["verifier"])
    if ours["map"] != theirs["map"]:
        raise mismatch(path, "features of this map's places", "those of another map")


def _safetensors(module: str) -> Any:
    name = f"safetensors.{module}".rstrip(".")
    return require(name, "a file of local features", "safetensors", "surefix[learned]")
