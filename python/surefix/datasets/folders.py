"""Any two folders of images, with a truth or positions beside them."""

from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix.datasets.images import Images, open_images
from surefix.datasets.origin import Origin
from surefix.datasets.pair import Pair, identity
from surefix.datasets.positions import local_metres, pair_by_position
from surefix.datasets.rows import decimal, header_and_rows, whole
from surefix.errors import SurefixFileError, SurefixValueError

__all__ = ["FOLDERS", "both", "folders", "read_truth"]

FOLDERS = Origin("Two folders", "your own images", "yours")
_PLANES = (("x", "y"), ("easting", "northing"), ("east", "north"))
_POSITION_COLUMNS = "x,y[,z], easting,northing or latitude,longitude, and name or not"


def folders(
    root: str | PathLike[str] = ".",
    *,
    references: str = "reference",
    queries: str = "query",
    truth: str | None = None,
    reference_positions: str | None = None,
    query_positions: str | None = None,
    tolerance: float = 10.0,
    source: str = FOLDERS.source,
    licence: str = FOLDERS.licence,
) -> Pair:
    """Two folders of images, or two ``.npy`` of images, and what is known of their places.

    Names are relative to ``root``; absolute paths are taken as they are.

    Parameters ---------- root : str or path references, queries : str A folder, a pattern like
    ``summer/*.png``, or a ``.npy`` of uint8 (n, H, W) or (n, H, W, 3). Files are in the order a
    person would put them in: ``frame10`` follows ``frame9``. truth : str, optional ``"identity"``
    where query ``i`` shows the place of reference ``i``; or a CSV with the columns
    ``query,reference``, one row a query, ``-1`` or empty where there is no place; or a ``.npy`` of
    integers (m,). reference_positions, query_positions : str, optional A CSV with a header: ``x,y``
    or ``x,y,z`` or ``easting,northing`` in metres, or ``latitude,longitude`` in degrees. A row an
    image, in their order; or with a column ``name``, the image's file name, in any order. tolerance
    : float Where there are positions and no ``truth``: the truth is the nearest reference within so
    many metres. source, licence : str Where the images come from, for the report.

    Raises
    ------
    SurefixFileError
        For a folder or a file that is not there.
    SurefixValueError
        For a malformed row, a count that does not agree, or positions of one traverse only.

    Examples
    --------
    >>> folders("corridor", truth="ground_truth.csv")                                           # doctest: +SKIP
    Pair('reference / query': 111 references, 111 queries, 111 with a true place)
    """
    base = Path(root)
    origin = Origin(FOLDERS.title, source, licence)
    name = f"{Path(references).stem} / {Path(queries).stem}"
    mapped = _images(origin, base / references, "the reference images")
    driven = _images(origin, base / queries, "the query images")
    if (reference_positions is None) != (query_positions is None):
        given = "reference_positions" if query_positions is None else "query_positions"
        raise SurefixValueError(
            f"{name}: expected positions of both traverses or of none, got {given} alone"
        )
    metres: tuple[npt.NDArray[np.float64] | None, npt.NDArray[np.float64] | None] = (None, None)
    if reference_positions is not None and query_positions is not None:
        first = _Positions(
            origin.file(base / reference_positions, "the positions of the references"), mapped
        )
        second = _Positions(
            origin.file(base / query_positions, "the positions of the queries"), driven
        )
        metres = _on_one_plane(first, second)
    known = None
    if truth == "identity":
        known = identity(name, mapped, driven)
    elif truth is not None:
        known = read_truth(
            origin.file(base / truth, "the true place of each query"), len(mapped), len(driven)
        )
    elif metres[0] is not None and metres[1] is not None:
        known = pair_by_position(metres[0], metres[1], tolerance)
    return Pair(name, mapped, driven, known, metres[0], metres[1], source, licence)


def both(root: Path) -> list[str]:
    """The folders ``reference`` and ``query``, where they are there."""
    return [name for name in ("reference", "query") if (root / name).is_dir()]


def _images(origin: Origin, place: Path, purpose: str) -> Images:
    if place.suffix == ".npy":
        return open_images(origin.file(place, purpose))
    if not any(letter in str(place) for letter in "*?["):
        origin.folder(place, purpose)
    return open_images(place)


def read_truth(path: Path, places: int, queries: int) -> npt.NDArray[np.int64]:
    """The true place of each query, -1 for none, from a CSV or a ``.npy`` as ``folders`` takes it.

    Raises
    ------
    SurefixFileError
        Where it cannot be read.
    SurefixValueError
        For a malformed row, or a query without one.
    """
    if path.suffix == ".npy":
        return _truth_array(path, queries)
    header, numbered = header_and_rows(path, "query,reference")
    if "query" not in header or "reference" not in header:
        raise SurefixValueError(
            f"{path}, row 1: expected the columns query,reference, got {','.join(header)}"
        )
    truth = np.full(queries, -2, dtype=np.int64)
    for row, cells in numbered:
        query = whole(cells[header.index("query")], path, row, "the index of a query")
        place = whole(
            cells[header.index("reference")] or "-1", path, row, "the index of a reference"
        )
        if not 0 <= query < queries:
            raise SurefixValueError(
                f"{path}, row {row}: expected a query from 0 to {queries - 1}, got {query}"
            )
        if not -1 <= place < places:
            raise SurefixValueError(
                f"{path}, row {row}: expected a reference from -1 to {places - 1}, got {place}"
            )
        if truth[query] != -2:
            raise SurefixValueError(
                f"{path}, row {row}: expected each query once, got query {query} twice"
            )
        truth[query] = place
    missing = np.flatnonzero(truth == -2)
    if len(missing):
        raise SurefixValueError(
            f"{path}: expected a row for each of the {queries} queries, got {queries - len(missing)}; "
            f"the first that lacks one is {missing[0]}"
        )
    return truth


def _truth_array(path: Path, queries: int) -> npt.NDArray[np.int64]:
    try:
        array: npt.NDArray[Any] = np.load(path, allow_pickle=False)
    except OSError as error:
        raise SurefixFileError(
            f"{path}: cannot read the truth: {error.strerror or error}"
        ) from None
    except (ValueError, EOFError) as error:
        raise SurefixValueError(
            f"{path}: not a .npy array of numbers, or a truncated one ({error})"
        ) from None
    if array.shape != (queries,) or array.dtype.kind not in "iu":
        raise SurefixValueError(
            f"{path}: expected integers ({queries},), one a query, got {array.dtype} {array.shape}"
        )
    return array.astype(np.int64)


class _Positions:
    """A table of positions, a row an image: metres, or degrees that await a common origin."""

    def __init__(self, path: Path, images: Images) -> None:
        header, numbered = header_and_rows(path, _POSITION_COLUMNS)
        self.path = path
        self.degrees = {"latitude", "longitude"} <= set(header)
        columns = next((list(plane) for plane in _PLANES if set(plane) <= set(header)), None)
        if columns is not None:
            self.degrees = False
            columns += ["z"] if "z" in header and columns[0] == "x" else []
        elif self.degrees:
            columns = ["latitude", "longitude"]
        else:
            got = ",".join(header)
            raise SurefixValueError(
                f"{path}, row 1: expected the columns {_POSITION_COLUMNS}, got {got}"
            )
        at = [header.index(column) for column in columns]
        values = [
            [decimal(cells[i], path, row, column) for i, column in zip(at, columns, strict=True)]
            for row, cells in numbered
        ]
        if "name" in header:
            values = self._by_name(
                [cells[header.index("name")] for _, cells in numbered], numbered, values, images
            )
        if len(values) != len(images):
            raise SurefixValueError(
                f"{path}: expected a row for each of the {len(images)} images, got {len(values)}"
            )
        self.values = np.array(values, dtype=np.float64)

    def _by_name(
        self,
        names: list[str],
        numbered: list[tuple[int, list[str]]],
        values: list[list[float]],
        images: Images,
    ) -> list[list[float]]:
        table: dict[str, list[float]] = {}
        for name, (row, _), value in zip(names, numbered, values, strict=True):
            if name in table:
                raise SurefixValueError(
                    f"{self.path}, row {row}: expected each image once, got {name} twice"
                )
            table[name] = value
        lacking = [name for name in images.names if name not in table]
        if lacking:
            raise SurefixValueError(
                f"{self.path}: expected a position for each of the {len(images)} images, "
                f"got none for {len(lacking)}, such as {lacking[0]}"
            )
        return [table[name] for name in images.names]


def _on_one_plane(
    references: _Positions, queries: _Positions
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    if references.degrees != queries.degrees:
        in_degrees, other = (references, queries) if references.degrees else (queries, references)
        raise SurefixValueError(
            f"{other.path}: expected latitude,longitude as in {in_degrees.path}, got metres: they share no plane"
        )
    if not references.degrees:
        return references.values, queries.values
    latitude, longitude = references.values.mean(axis=0)
    if (
        np.ptp(references.values[:, 1]) > 180
    ):  # across the date line the mean is on the other side of the globe
        longitude = references.values[0, 1]
    origin = (float(latitude), float(longitude))
    first, second = references.values, queries.values
    return local_metres(first[:, 0], first[:, 1], origin), local_metres(
        second[:, 0], second[:, 1], origin
    )
