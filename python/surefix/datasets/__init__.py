"""Public data sets in their publishers' layout, and your own: two traverses of a route and a truth.

>>> from surefix import datasets
>>> pair = datasets.gardens_point("data/gardens_point")   # doctest: +SKIP
>>> route = surefix.Map.from_images(pair.references.paths)   # doctest: +SKIP
>>> run = surefix.match(route, pair.queries.paths)   # doctest: +SKIP
>>> surefix.evaluate(run, pair.truth)   # doctest: +SKIP

Nothing is downloaded. A loader reads the small tables at once and the images when they are asked
for. The error for a missing file names it, its purpose, and the source and licence of the data set.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import Any

from surefix.datasets.folders import FOLDERS, both, folders
from surefix.datasets.four_seasons import FOUR_SEASONS, OFFICE_LOOP, four_seasons, recordings
from surefix.datasets.gardens_point import GARDENS_POINT, gardens_point, walks
from surefix.datasets.nordland import NORDLAND, nordland, seasons
from surefix.datasets.pair import Origin, Pair
from surefix.datasets.robotcar import ROBOTCAR, drives, robotcar
from surefix.errors import mismatch
from surefix.frames.bayer import demosaic
from surefix.frames.images import BayerFiles, ImageArray, ImageFiles, Images
from surefix.tables.fix_files import write_track
from surefix.tables.metres import local_metres, pair_by_position, places_per_metre, subsample

__all__ = [
    "DATASETS",
    "OFFICE_LOOP",
    "BayerFiles",
    "Dataset",
    "ImageArray",
    "ImageFiles",
    "Images",
    "Origin",
    "Pair",
    "demosaic",
    "folders",
    "four_seasons",
    "gardens_point",
    "load",
    "local_metres",
    "nordland",
    "pair_by_position",
    "places_per_metre",
    "robotcar",
    "subsample",
    "traverses",
    "write_track",
]


@dataclass(frozen=True)
class Dataset:
    """A data set by name: its loader, a lister of a folder's traverses, and its origin."""

    load: Callable[..., Pair]
    traverses: Callable[[Path], list[str]]
    origin: Origin

    @property
    def signs(self) -> tuple[str, ...]:
        """Patterns: a folder in which any of them is found looks like this data set."""
        return self.origin.signs

    @property
    def options(self) -> dict[str, Any]:
        """The loader's options with their defaults; ``root`` is not among them."""
        parameters = list(inspect.signature(self.load).parameters.values())[1:]
        return {parameter.name: parameter.default for parameter in parameters}


DATASETS: Mapping[str, Dataset] = MappingProxyType(
    {
        "gardens_point": Dataset(gardens_point, walks, GARDENS_POINT),
        "nordland": Dataset(nordland, seasons, NORDLAND),
        "four_seasons": Dataset(four_seasons, recordings, FOUR_SEASONS),
        "robotcar": Dataset(robotcar, drives, ROBOTCAR),
        "folders": Dataset(folders, both, FOLDERS),
    }
)


def load(name: str, root: str | PathLike[str], **options: Any) -> Pair:
    """A data set by its name, for the command line.

    Parameters
    ----------
    name : str
        One of ``DATASETS``; ``-`` reads as ``_``.
    root : str or path
        The folder that the data set lies in.
    **options
        Those of that data set's own function.

    Raises
    ------
    SurefixValueError
        For an unknown name or option, and as that function says.
    SurefixFileError
        For a file that is missing.

    Examples
    --------
    >>> load("gardens_point", "data/gardens_point", query="night_right")   # doctest: +SKIP
    Pair('Gardens Point day_left / night_right': 200 references, 200 queries, 200 with a true place)
    """
    dataset = _named(name)
    for option in options:
        if option not in dataset.options:
            raise mismatch(name, f"the options {', '.join(dataset.options)}", repr(option))
    return dataset.load(root, **options)


def traverses(name: str, root: str | PathLike[str]) -> list[str]:
    """The traverses of a data set that exist: the values of its loader's ``reference``, ``query``.

    The first is the one to make the map of: by day on the left, summer, or the oldest. Folders are
    not opened.

    Parameters
    ----------
    name : str
        One of ``DATASETS``; ``-`` reads as ``_``.
    root : str or path
        The folder that the data set lies in.

    Raises
    ------
    SurefixValueError
        For an unknown name.
    SurefixFileError
        If the folder is missing.

    Examples
    --------
    >>> traverses("gardens_point", "data/gardens_point")   # doctest: +SKIP
    ['day_left', 'day_right', 'night_right']
    """
    dataset = _named(name)
    return dataset.traverses(dataset.origin.folder(root, "the folder that the data set lies in"))


def _named(name: str) -> Dataset:
    dataset = DATASETS.get(name.replace("-", "_"))
    if dataset is None:
        raise mismatch("data set", f"one of {', '.join(DATASETS)}", repr(name))
    return dataset
