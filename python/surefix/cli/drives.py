"""What ``surefix eval`` compares on: a map and queries, or ready distances, with their images where there are any."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix import Map, SurefixFileError, SurefixValueError
from surefix._progress import terminal_bar
from surefix.cli.frames import Frames
from surefix.datasets.images import Images, open_images

__all__ = ["Drives", "open_drives", "read_matrix", "reference_images"]

Image = npt.NDArray[np.uint8]


@dataclass(eq=False)
class Drives:
    """A map and the queries of a drive, not yet compared; or their ready distances.

    Attributes
    ----------
    places, queries : int
        How many there are.
    images : sequence of uint8 images, or None
        Those of the queries.
    """

    places: int
    queries: int
    matrix: npt.NDArray[np.float32] | None = None
    map: Map | None = None
    frames: Frames | None = None
    images: Images | None = None

    @property
    def names(self) -> Sequence[str] | None:
        """Names of the queries."""
        return None if self.images is None else self.images.names

    @property
    def place_names(self) -> Sequence[str] | None:
        """Names of the places."""
        return None if self.map is None else self.map.names

    @property
    def positions(self) -> npt.NDArray[np.float64] | None:
        """Those of the places, where the map has them."""
        return None if self.map is None else self.map.positions

    def distances(self) -> npt.NDArray[np.float32]:
        """Between each place and each query, shape (n, m)."""
        if self.matrix is not None:
            return self.matrix
        assert self.map is not None
        assert self.frames is not None
        described = self._descriptors()
        D = np.empty((self.places, self.queries), np.float32, order="F")
        bar = terminal_bar("Comparing")
        for query, descriptor in enumerate(described):
            D[:, query] = self.map.distances(descriptor)
            if bar is not None:
                bar(query + 1, self.queries)
        return D

    def _descriptors(self) -> npt.NDArray[Any]:
        assert self.map is not None
        assert self.frames is not None
        if self.frames.descriptors is not None:
            return self.frames.descriptors
        if self.map.descriptor is None:
            raise SurefixValueError(
                "QUERIES: expected descriptors, a .npy (m, dim), as this map holds ready descriptors; got images"
            )
        # A map of the queries, for the parallel reading and describing of one.
        return Map.from_images(self.frames.images, self.map.descriptor, progress=terminal_bar("Describing")).descriptors


def open_drives(route: str, queries: str | None, similarity: bool) -> Drives:
    """What ROUTE and QUERIES name.

    Raises
    ------
    SurefixError
        Where one cannot be read, or they do not fit.
    """
    if Path(route).suffix == ".npy":
        matrix = read_matrix(Path(route), similarity)
        images = None if queries is None else open_images(Path(queries))
        if images is not None and len(images) != matrix.shape[1]:
            got = f"{len(images)} images for {matrix.shape[1]} queries"
            raise SurefixValueError(f"{queries}: expected an image for each column of {route}, got {got}")
        return Drives(matrix.shape[0], matrix.shape[1], matrix=matrix, images=images)
    if Path(route).is_dir():
        raise SurefixValueError(
            f"{route}: expected a map or a matrix, got a folder; make a map of it: surefix map build {route}"
        )
    known = Map.open(route)
    assert queries is not None
    frames = Frames(queries)
    images = open_images(Path(queries)) if frames.descriptors is None else None
    return Drives(len(known), len(frames), map=known, frames=frames, images=images)


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
        raise SurefixFileError(f"{file}: cannot read the matrix: {error.strerror or error}") from None
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
    images = open_images(Path(place))
    if len(images) != places:
        raise SurefixValueError(
            f"--references {place}: expected an image for each of {places} places, got {len(images)}"
        )
    return images
