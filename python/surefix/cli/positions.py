"""Positions in metres, from a file."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from surefix import SurefixError, SurefixFileError, SurefixValueError
from surefix.datasets import local_metres
from surefix.datasets.rows import decimal, header_and_rows, rows

__all__ = ["Positions", "on_one_plane", "read_either", "read_positions"]

DEGREES = (("latitude", "longitude"), ("lat", "lon"))
METRES = (("x", "y", "z"), ("x", "y"), ("easting", "northing"), ("east", "north"))
COLUMNS = "latitude,longitude (or lat,lon) in degrees, or x,y[,z] or easting,northing in metres"


@dataclass(frozen=True, eq=False)
class Positions:
    """A row a frame, in their order: metres; or latitude and longitude, which await a common
    origin.
    """

    source: str
    values: npt.NDArray[np.float64]
    degrees: bool = False


def read_positions(file: Path) -> npt.NDArray[np.float64]:
    """A ``.npy`` or ``.csv`` of 2 or 3 numbers a frame, in planar metres.

    Raises
    ------
    SurefixError
        Where the file cannot be read, or holds something else.
    """
    read = read_either(file)
    if read.degrees:
        raise SurefixValueError(
            f"{file}: expected metres, as a map holds no degrees, got latitude and longitude; "
            "surefix.datasets.local_metres makes metres of them, with one origin for all drives"
        )
    return read.values


def read_either(file: Path) -> Positions:
    """A ``.npy`` or ``.csv`` of 2 or 3 metres a frame; or a ``.csv`` whose header says what its
    columns are.

    Raises
    ------
    SurefixError
        Where the file cannot be read, holds something else, or holds degrees without saying so.
    """
    try:
        if file.suffix == ".npy":
            values = np.asarray(np.load(file, allow_pickle=False), np.float64)
        elif _has_header(file):
            return _by_header(file)
        else:
            values = np.loadtxt(file, delimiter=",", ndmin=2)
    except SurefixError:
        raise
    except OSError as error:
        raise SurefixFileError(
            f"{file}: cannot read the positions: {error.strerror or error}"
        ) from None
    except (ValueError, EOFError) as error:
        raise SurefixValueError(
            f"{file}: expected a row of 2 or 3 numbers a place ({error})"
        ) from None
    if _look_like_degrees(values):
        raise SurefixValueError(
            f"{file}: expected metres, got numbers that look like latitude and longitude, such as "
            f"{values[0].tolist()}; give a .csv with the header latitude,longitude, or metres (header x,y)"
        )
    return Positions(str(file), values)


def on_one_plane(
    references: Positions, queries: Positions
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Both in metres; degrees become metres about one origin, the mean of all.

    Raises
    ------
    SurefixValueError
        Where one is in degrees and the other in metres.
    """
    if references.degrees != queries.degrees:
        given, other = (references, queries) if references.degrees else (queries, references)
        raise SurefixValueError(
            f"{other.source}: expected latitude,longitude as in {given.source}, got metres: they share no plane"
        )
    if not references.degrees:
        return references.values, queries.values
    metres = local_metres(*np.concatenate([references.values, queries.values]).T)
    return metres[: len(references.values)], metres[len(references.values) :]


def _has_header(file: Path) -> bool:
    first = next((cells for _, cells in rows(file, ",")), [])
    return bool(first) and not any(_numeric(cell) for cell in first)


def _numeric(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _by_header(file: Path) -> Positions:
    header, numbered = header_and_rows(file, COLUMNS)
    columns = next((names for names in (*METRES, *DEGREES) if set(names) <= set(header)), None)
    if columns is None:
        raise SurefixValueError(
            f"{file}, row 1: expected the columns {COLUMNS}, got {','.join(header)}"
        )
    at = [header.index(column) for column in columns]
    values = np.array(
        [
            [decimal(cells[i], file, row, column) for i, column in zip(at, columns, strict=True)]
            for row, cells in numbered
        ]
    )
    degrees = columns in DEGREES
    if degrees:
        try:
            local_metres(*values.T)
        except SurefixValueError as error:
            raise SurefixValueError(f"{file}: {error}") from None
    return Positions(str(file), values, degrees)


def _look_like_degrees(values: npt.NDArray[np.float64]) -> bool:
    """Two or more places that lie within a metre of each other, as far from 0 as degrees may be: no
    drive in metres.
    """
    if values.ndim != 2 or values.shape[1] not in (2, 3) or len(values) < 2:
        return False
    plane = values[:, :2]
    far = np.sort(np.abs(plane).max(axis=0))
    return bool((np.ptp(plane, axis=0) < 1).all() and far[0] <= 90 and far[1] <= 180)
