"""Nordland: a railway line in four seasons, as partitioned by Olid, Facil and Civera (2018)."""

from os import PathLike
from pathlib import Path
from typing import Literal

from surefix.datasets.pair import Origin, Pair, same_places
from surefix.errors import mismatch
from surefix.frames.images import Images, open_images

SEASONS = ("summer", "winter", "fall", "spring")
NORDLAND = Origin(
    "Nordland, partitioned",
    "https://webdiis.unizar.es/~jmfacil/pr-nordland/ (D. Olid, J. M. Facil, J. Civera; NRK)",
    "the film is under a Creative Commons licence of NRK; which one, see that page",
    signs=(
        *(f"{season}_*.npy" for season in SEASONS),
        "test/*_images_test",
        "Dataset_images/test",
        "Partitioned_Nordland_Dataset*",
    ),
)
SECTIONS = {"test": (1, 2, 3), "train": (1, 2)}
_INSIDE = ("", "Dataset_images", "Partitioned_Nordland_Dataset/Dataset_images",
           "Partitioned_Nordland_Dataset_lowres/Dataset_images")  # fmt: skip


def nordland(
    root: str | PathLike[str],
    *,
    reference: str = "summer",
    query: str = "winter",
    split: Literal["test", "train"] = "test",
    section: int = 2,
) -> Pair:
    """Two seasons of a section of the partitioned Nordland set. Query ``i`` shows the place of
    reference ``i``.

    Layout, with ``root`` any folder on the way down to ``test``::

        Partitioned_Nordland_Dataset/Dataset_images/test/summer_images_test/section2/1150.png ...

    The file's name is the frame's number, the same in all seasons; frames are in the order of their
    numbers. A test section has 1150, tunnels and stops left out. A folder with one array of images
    a season, ``summer_*.npy`` uint8 (n, H, W) or (n, H, W, 3), is taken too, of any section.

    Parameters
    ----------
    root : str or path
    reference, query : {"summer", "winter", "fall", "spring"}
    split : {"test", "train"}
    section : int
        1 to 3 of ``test``, 1 or 2 of ``train``.

    Returns
    -------
    Pair
        With the identity as the truth, and no positions.

    Raises
    ------
    SurefixFileError
        For a season or section that is missing.
    SurefixValueError
        For an unknown season or section, one without images, or a frame that only one of the two
        has.
    """
    for option, season in (("reference", reference), ("query", query)):
        if season not in SEASONS:
            raise mismatch(option, f"one of {', '.join(SEASONS)}", repr(season))
    if section not in SECTIONS.get(split, ()):
        known = ", ".join(f"{part} {list(numbers)}" for part, numbers in SECTIONS.items())
        raise mismatch("section", f"one of {known}", f"{split} {section}")
    folder = NORDLAND.folder(root, "with the folder test or train of the partitioned set")
    name = f"Nordland {split} {section} {reference} / {query}"
    references, queries = (_season(folder, season, split, section) for season in (reference, query))
    return same_places(name, NORDLAND, references, queries)


def seasons(root: Path) -> list[str]:
    """The seasons that exist, as arrays or in the folder ``test``, summer first."""
    folders = [root / inside / "test" for inside in _INSIDE]
    return [
        season
        for season in SEASONS
        if any(root.glob(f"{season}_*.npy"))
        or any((test / f"{season}_images_test").is_dir() for test in folders)
    ]


def _season(root: Path, season: str, split: str, section: int) -> Images:
    arrays = sorted(root.glob(f"{season}_*.npy"))
    if len(arrays) > 1:
        raise mismatch(root, f"one {season}_*.npy", ", ".join(path.name for path in arrays))
    if arrays:
        return open_images(arrays[0])
    within = Path(split, f"{season}_images_{split}", f"section{section}")
    found = [root / inside / within for inside in _INSIDE if (root / inside / within).is_dir()]
    folder = found[0] if found else root / within
    return open_images(NORDLAND.folder(folder, f"the images of {season}"))
