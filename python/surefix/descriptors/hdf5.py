"""Vectors in HDF5: one data set of all, or a group an image, as hloc writes them."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix._extra import needed
from surefix.errors import SurefixValueError

__all__ = ["read_hdf5"]

# How many names an error lists.
LISTED = 12


def read_hdf5(path: Path, key: str | None) -> npt.NDArray[Any]:
    """The data set ``key``; or the data sets of this name in all groups, one row each, ``frame10``
    after ``frame9``.

    Raises
    ------
    SurefixValueError
        Where there is no such data set, or it is not one file of vectors.
    SurefixError
        Where h5py is missing.
    """
    library = needed("h5py", "an HDF5 file", "h5py", "surefix[files]")
    try:
        with library.File(path, "r") as file:
            found: dict[str, Any] = {}

            def visit(name: str, thing: Any) -> None:
                if isinstance(thing, library.Dataset):
                    found[name] = thing

            file.visititems(visit)
            return _chosen(path, key, found)
    except OSError as error:
        raise SurefixValueError(f"{path}: not an HDF5 file, or a truncated one ({error})") from None


def _chosen(path: Path, key: str | None, found: dict[str, Any]) -> npt.NDArray[Any]:
    name = None if key is None else key.strip("/")
    if name is None and len(found) == 1:
        (name,) = found
    if name in found:
        whole: npt.NDArray[Any] = np.asarray(found[name])
        return whole
    of_images = [full for full in found if "/" in full and full.rpartition("/")[2] == name]
    if name is None or not of_images:
        got = "no key" if key is None else f"the key {key!r}"
        raise SurefixValueError(
            f"{path}: expected one of the data sets {_listed(found)}, got {got}"
        )
    rows = [np.asarray(found[full]) for full in sorted(of_images, key=_as_counted)]
    for full, row in zip(sorted(of_images, key=_as_counted), rows, strict=True):
        if row.ndim != 1 or row.shape != rows[0].shape:
            raise SurefixValueError(
                f"{path}, {full}: expected a vector of {rows[0].size} numbers as in the first group, "
                f"got the shape {row.shape}"
            )
    return np.stack(rows)


def _as_counted(name: str) -> list[tuple[int, int, str]]:
    """The order that ``find_images`` puts files in: numbers by their value."""
    pieces = re.findall(r"\d+|\D+", name)
    return [(0, int(piece), piece) if piece.isdecimal() else (1, 0, piece) for piece in pieces]


def _listed(found: dict[str, Any]) -> str:
    # Of many groups with the same data sets, the data sets' names say more.
    short = (
        sorted({name.rpartition("/")[2] for name in found})
        if len(found) > LISTED
        else sorted(found)
    )
    return (
        ", ".join(short[:LISTED]) + (", ..." if len(short) > LISTED else "")
        if short
        else "(there are none)"
    )
