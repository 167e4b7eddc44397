"""The array of a ``.npy``."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix.errors import SurefixValueError, mismatch, refusal


def read_npy(path: str | Path, what: str, *, mapped: bool = False) -> npt.NDArray[Any]:
    """The array; ``what`` names it in an error: "the truth". ``mapped``: memory-mapped."""
    try:
        mode: Any = "r" if mapped else None
        array: npt.NDArray[Any] = np.load(path, mmap_mode=mode, allow_pickle=False)
    except OSError as error:
        raise refusal(path, f"cannot read {what}", error) from None
    except (ValueError, EOFError) as error:
        raise SurefixValueError(f"{path}: not a .npy array, or a truncated one ({error})") from None
    if not isinstance(array, np.ndarray):
        array.close()
        raise mismatch(path, "one array (.npy)", "an archive of several (.npz)")
    return array
