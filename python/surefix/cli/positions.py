"""Positions in metres, from a file."""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from surefix import SurefixFileError, SurefixValueError

__all__ = ["read_positions"]


def read_positions(file: Path) -> npt.NDArray[np.float64]:
    """A ``.npy`` or ``.csv`` of 2 or 3 numbers a frame, in planar metres.

    Raises
    ------
    SurefixError
        Where the file cannot be read, or holds something else.
    """
    try:
        if file.suffix == ".npy":
            return np.asarray(np.load(file, allow_pickle=False), np.float64)
        return np.loadtxt(file, delimiter=",", ndmin=2)
    except OSError as error:
        raise SurefixFileError(f"{file}: cannot read the positions: {error.strerror or error}") from None
    except (ValueError, EOFError) as error:
        raise SurefixValueError(f"{file}: expected a row of 2 or 3 numbers a place ({error})") from None
