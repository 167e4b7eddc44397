"""Any two folders of images, with a truth or positions beside them."""

from os import PathLike
from pathlib import Path

import numpy as np

from surefix.datasets.pair import Origin, Pair, identity
from surefix.errors import mismatch
from surefix.frames.images import Images, open_images
from surefix.tables.metres import pair_by_position
from surefix.tables.positions import on_one_plane, read_positions
from surefix.tables.truth import read_truth

FOLDERS = Origin("Two folders", "your own images", "yours", signs=("reference",))


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
    """Two folders of images, or two ``.npy`` of images, with a truth or positions if known.

    Names are relative to ``root``; absolute paths are taken as they are.

    Parameters
    ----------
    root : str or path
    references, queries : str
        A folder, a pattern like ``summer/*.png``, or a ``.npy`` of uint8 (n, H, W) or
        (n, H, W, 3). ``frame10`` follows ``frame9``.
    truth : str, optional
        ``"identity"`` if query ``i`` shows the place of reference ``i``; or a CSV with the columns
        ``query,reference``, one row a query, ``-1`` or empty for none; or a ``.npy`` of integers
        (m,).
    reference_positions, query_positions : str, optional
        A CSV with a header: ``x,y`` or ``x,y,z`` or ``easting,northing`` in metres, or
        ``latitude,longitude`` in degrees. A row an image, in their order; or with a column
        ``name``, the image's file name, in any order.
    tolerance : float
        With positions and no ``truth``: the truth is the nearest reference within these metres.
    source, licence : str
        Where the images come from, for the report.

    Raises
    ------
    SurefixFileError
        For a folder or a file that is missing.
    SurefixValueError
        For a malformed row, a count that does not agree, or positions of one traverse only.

    Examples
    --------
    >>> folders("corridor", truth="ground_truth.csv")                # doctest: +SKIP
    Pair('reference / query': 111 references, 111 queries, 111 with a true place)
    """
    base = Path(root)
    origin = Origin(FOLDERS.title, source, licence)
    name = f"{Path(references).stem} / {Path(queries).stem}"
    mapped = _images(origin, base / references, "the reference images")
    driven = _images(origin, base / queries, "the query images")
    if (reference_positions is None) != (query_positions is None):
        given = "reference_positions" if query_positions is None else "query_positions"
        raise mismatch(name, "positions of both traverses or of none", f"{given} alone")
    there = here = known = None
    if reference_positions is not None and query_positions is not None:
        first = origin.file(base / reference_positions, "the positions of the references")
        second = origin.file(base / query_positions, "the positions of the queries")
        of_map, of_drive = read_positions(first, mapped.names), read_positions(second, driven.names)
        there, here = on_one_plane(of_map, of_drive)
        known = pair_by_position(there, here, tolerance)
    if truth == "identity":
        known = identity(name, mapped, driven)
    elif truth is not None:
        file = origin.file(base / truth, "the true place of each query")
        known = read_truth(file, len(mapped), len(driven))
        if known.dtype.kind == "f":
            got = f"nan for query {np.isnan(known).argmax()}"
            raise mismatch(file, "a place for each query, or -1 for none", got)
    return Pair(name, mapped, driven, known, there, here, source, licence)


def both(root: Path) -> list[str]:
    """Those of the folders ``reference`` and ``query`` that exist."""
    return [name for name in ("reference", "query") if (root / name).is_dir()]


def _images(origin: Origin, place: Path, purpose: str) -> Images:
    if place.suffix == ".npy":
        return open_images(origin.file(place, purpose))
    if not any(letter in str(place) for letter in "*?["):
        origin.folder(place, purpose)
    return open_images(place)
