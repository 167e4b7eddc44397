"""What of the paper's data lies in a folder, and what is wrong with what does not load."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from surefix import datasets
from surefix.baselines.truth import Truth
from surefix.errors import SurefixError, SurefixFileError
from surefix.reproduce.case import Case
from surefix.reproduce.images import SAD, sad_distances
from surefix.reproduce.matrices import as_distances, kind, read_matrix

__all__ = ["METRES", "Found", "find_datasets", "load_cases"]

# How near is correct where a data set has positions; its loader's own tolerance.
METRES = 10.0

# What a data set's folder has in it: any of these patterns.
SIGNS = {
    "gardens_point": ("day_left", "day_right", "night_right"),
    "nordland": (
        "summer_*.npy",
        "winter_*.npy",
        "test/*_images_test",
        "Dataset_images/test",
        "Partitioned_Nordland_Dataset*",
    ),
    "four_seasons": ("recording_*",),
    "robotcar": ("20??-??-??-??-??-??",),
    "folders": ("reference",),
}


@dataclass(frozen=True)
class Found:
    """A folder that looks like a data set."""

    dataset: str
    folder: Path

    @property
    def title(self) -> str:
        """Its name in the tables: the data set's, or its own folder's."""
        if self.dataset == "folders":
            return self.folder.name
        return datasets.DATASETS[self.dataset].origin.title.partition(",")[0]


def find_datasets(folder: Path) -> list[Found]:
    """The data sets in a folder and in the folders right below it.

    Raises
    ------
    SurefixFileError
        Where the folder is not there.
    """
    if not folder.is_dir():
        raise SurefixFileError(f"{folder}: no such folder (--data: the folder with the data sets)")
    try:
        below = sorted(path for path in folder.iterdir() if path.is_dir())
        candidates = [found for place in (folder, *below) if (found := _looks_like(place)) is not None]
    except OSError as error:
        raise SurefixFileError(f"{error.filename}: cannot list the folder: {error.strerror}") from None
    # A data set found at the top is not found once more in its own parts.
    return candidates[:1] if candidates and candidates[0].folder == folder else candidates


def load_cases(found: Found) -> tuple[Sequence[Case], Sequence[str]]:
    """Its cases, SAD first and then its ready matrices; and what could not be used, and why."""
    options = {}
    if found.dataset == "folders":
        known = (found.folder / "ground_truth.csv").is_file()
        options = {"truth": "ground_truth.csv" if known else "identity"}
    try:
        pair = datasets.load(found.dataset, found.folder, **options)
        truth, tolerance = _truth(pair)
        notes = tuple(pair.notes)
        source = f"images in {found.folder}"
        D = sad_distances(pair.references, pair.queries)
        cases = [Case(found.title, SAD, D, truth, tolerance, source=source, notes=notes)]
    except SurefixError as error:
        return [], [str(error)]
    problems = []
    for path in sorted((found.folder / "matrices").glob("*.npy")):
        try:
            cases.append(_matrix(found, path, truth, tolerance))
        except SurefixError as error:
            problems.append(str(error))
    return cases, problems


def _matrix(found: Found, path: Path, truth: Truth, tolerance: float) -> Case:
    for word in ("similarity", "distance"):
        technique, separator, _ = path.stem.partition(f"_{word}")
        if separator:
            similarity = word == "similarity"
            D = as_distances(read_matrix(path), similarity, path)
            source = f"ready {kind(similarity)}, {path}"
            return Case(found.title, technique, D, truth, tolerance, source=source)
    raise SurefixFileError(f"{path}: expected NAME_similarity*.npy or NAME_distance*.npy, to tell which it holds")


def _truth(pair: datasets.Pair) -> tuple[Truth, float]:
    if pair.reference_positions is not None and pair.query_positions is not None:
        return (pair.reference_positions, pair.query_positions), METRES
    if pair.truth is None:
        raise SurefixFileError(f"{pair.name}: expected a truth, got none")
    return pair.truth, 1


def _looks_like(folder: Path) -> Found | None:
    for dataset, patterns in SIGNS.items():
        if any(_there(folder, patterns)):
            return Found(dataset, folder)
    return None


def _there(folder: Path, patterns: Sequence[str]) -> Iterator[Path]:
    for pattern in patterns:
        yield from folder.glob(pattern)
