"""What ``surefix eval`` compares on: a map and queries, or ready distances, with their images where
there are any.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import typer

from surefix import Localizer, Map, SurefixFileError, SurefixValueError
from surefix._progress import terminal_bar
from surefix.cli.network import network_of, no_model
from surefix.cli.queries import FrameQueries, Pictures, Queries, RecordedQueries
from surefix.cli.recording import is_recording
from surefix.cli.taking import Taking
from surefix.datasets.images import Images, open_images
from surefix.descriptors import Onnx

__all__ = ["Drives", "open_drives", "read_matrix", "reference_images"]


@dataclass(eq=False)
class Drives:
    """A map and the queries of a drive, not yet compared; or their ready distances.

    Attributes
    ----------
    places, queries : int
        How many there are.
    drive : Queries or None
        The queries themselves; none with ready distances.
    images : Images, Queries or None
        With ready distances: the images of the queries, if there are any.
    network, cache : optional
        What describes the images for a map of a network's, and where that is kept.
    """

    places: int
    queries: int
    matrix: npt.NDArray[np.float32] | None = None
    map: Map | None = None
    drive: Queries | None = None
    images: Images | Queries | None = None
    network: Onnx | None = None
    cache: Path | None = None

    @property
    def names(self) -> Sequence[str] | None:
        """Names of the queries."""
        shown = self.drive if self.images is None else self.images
        return None if shown is None else shown.names

    @property
    def place_names(self) -> Sequence[str] | None:
        """Names of the places."""
        return None if self.map is None else self.map.names

    @property
    def positions(self) -> npt.NDArray[np.float64] | None:
        """Those of the places, where the map has them."""
        return None if self.map is None else self.map.positions

    def pictures(self, wanted: Collection[int]) -> Pictures | None:
        """The images of these queries at least, where there are images."""
        shown = self.drive if self.images is None else self.images
        return shown.pictures(wanted) if isinstance(shown, Queries) else shown

    def distances(self) -> npt.NDArray[np.float32]:
        """Between each place and each query, shape (n, m)."""
        if self.matrix is not None:
            return self.matrix
        assert self.map is not None
        described = self._descriptors()
        D = np.empty((self.places, self.queries), np.float32, order="F")
        # What queries go through may depend on those before: that is known by a localizer, and not
        # by a map.
        localizer = Localizer(self.map, sequence_length=1) if _runs(self.map) else None
        bar = terminal_bar("Comparing")
        for query, descriptor in enumerate(described):
            if localizer is None:
                D[:, query] = self.map.distances(descriptor)
            else:
                localizer.push(descriptor)
                D[:, query] = localizer.distances
            if bar is not None:
                bar(query + 1, self.queries)
        return D

    def _descriptors(self) -> npt.NDArray[Any]:
        assert self.map is not None
        assert self.drive is not None
        if self.drive.ready is not None:
            return self.drive.ready
        if self.network is not None:
            return self.drive.by_network(self.network, self.cache)
        assert self.map.descriptor is not None
        return self.drive.by_sad(self.map.descriptor)


def open_drives(
    route: str,
    queries: str | None,
    similarity: bool,
    taking: Taking,
    model: Path | None = None,
    cache: Path | None = None,
) -> Drives:
    """What ROUTE and QUERIES name.

    Raises
    ------
    SurefixError
        Where one cannot be read, or they do not fit.
    BadParameter
        Where the options do not fit them.
    """
    if Path(route).suffix == ".npy":
        if model is not None:
            raise typer.BadParameter(
                f"--model: expected a map made with one, got the distances {route}"
            )
        matrix = read_matrix(Path(route), similarity)
        images = None if queries is None else _images(queries, taking)
        if images is not None and len(images) != matrix.shape[1]:
            got = f"{len(images)} images for {matrix.shape[1]} queries"
            raise SurefixValueError(
                f"{queries}: expected an image for each column of {route}, got {got}"
            )
        return Drives(matrix.shape[0], matrix.shape[1], matrix=matrix, images=images)
    if Path(route).is_dir():
        raise SurefixValueError(
            f"{route}: expected a map or a matrix, got a folder; make a map of it: surefix map build {route}"
        )
    known = Map.open(route)
    assert queries is not None
    network = None if model is None else network_of(known, route, model)
    drive = _queries(queries, taking)
    if drive.ready is not None:
        if model is not None:
            raise typer.BadParameter(
                f"--model: expected images, got the ready descriptors {queries}"
            )
        return Drives(len(known), len(drive), map=known, drive=drive)
    if network is None:
        _check_sad(known, route)
    return Drives(len(known), len(drive), map=known, drive=drive, network=network, cache=cache)


def _queries(place: str, taking: Taking) -> Queries:
    recorded = _recorded(place, taking)
    return FrameQueries(place) if recorded is None else recorded


def _images(place: str, taking: Taking) -> Queries | Images:
    recorded = _recorded(place, taking)
    return open_images(Path(place)) if recorded is None else recorded


def _recorded(place: str, taking: Taking) -> RecordedQueries | None:
    """The frames that are taken of a recording; None where this is something else, of which none
    can be chosen.
    """
    if is_recording(place):
        return RecordedQueries(taking.open(place))
    taking.check_none(place)
    return None


def _check_sad(known: Map, route: str) -> None:
    """Refuses images for a map whose descriptors something else than SAD made."""
    if known.descriptor is not None:
        return
    name = None if known.recipe is None else str(known.recipe.get("name"))
    if name is not None and name.startswith("onnx:"):
        raise no_model(name, route)
    holds = "holds ready descriptors" if name is None else f"is by {name!r}, which is no ONNX file"
    raise SurefixValueError(
        f"QUERIES: expected descriptors, a .npy (m, dim), as this map {holds}; got images"
    )


def _runs(known: Map) -> bool:
    return known.post is not None and any(
        step["step"] == "standardize_running" for step in known.post.steps
    )


def read_matrix(file: Path, similarity: bool) -> npt.NDArray[np.float32]:
    """A matrix of distances (n, m); of similarities ``s``, ``1 - s``.

    Raises
    ------
    SurefixError
        Where the file cannot be read, or is no such matrix.
    """
    try:
        array: npt.NDArray[Any] = np.load(file, allow_pickle=False)
    except OSError as error:
        raise SurefixFileError(
            f"{file}: cannot read the matrix: {error.strerror or error}"
        ) from None
    except (ValueError, EOFError) as error:
        raise SurefixValueError(f"{file}: not a .npy array, or a truncated one ({error})") from None
    if array.ndim != 2 or array.dtype.kind != "f" or array.shape[0] < 2 or array.shape[1] < 1:
        expected = "a matrix of floats, (2 or more places, 1 or more queries)"
        raise SurefixValueError(f"{file}: expected {expected}, got {array.dtype} {array.shape}")
    D = array.astype(np.float32)
    if similarity:
        D = np.float32(1) - D
    if not np.isfinite(D).all():
        place, query = np.argwhere(~np.isfinite(D))[0]
        raise SurefixValueError(
            f"{file}: expected finite numbers, got {array[place, query]} at place {place}, query {query}"
        )
    return D


def reference_images(place: str, places: int) -> Images:
    """The images of the places.

    Raises
    ------
    SurefixError
        Where there are none, or not as many as places.
    """
    if is_recording(place):
        raise SurefixValueError(
            f"--references: expected a folder of images, a pattern or a .npy, got the recording {place}; "
            "write its frames into a folder"
        )
    images = open_images(Path(place))
    if len(images) != places:
        raise SurefixValueError(
            f"--references {place}: expected an image for each of {places} places, got {len(images)}"
        )
    return images
