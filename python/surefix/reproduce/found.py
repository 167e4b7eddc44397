"""The paper's data sets in a folder, their cases, and the reasons why some do not load."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

import numpy as np

from surefix import datasets
from surefix._ray import mapped
from surefix.baselines.truth import Truth
from surefix.errors import SurefixError, SurefixFileError, mismatch, refusal
from surefix.reproduce.case import IDENTITY, SAD, Case, kind, sad_distances
from surefix.reproduce.exhibit import stem
from surefix.tables.matrices import read_matrix
from surefix.tables.truth import read_truth

__all__ = ["METRES", "Found", "check_pairs", "find_datasets", "load_cases", "read_pairs"]

# The tolerance if a data set has positions; its loader's own.
METRES = 10.0

# A folder of ready matrices, without images.
MATRICES = "matrices"
TRUTH = "ground_truth.csv"

# Their traverses correspond by position only, not image by image.
BY_POSITION = ("four_seasons", "robotcar")


@dataclass(frozen=True)
class Found:
    """A folder that looks like a data set; ``label`` tells it from another of the same."""

    dataset: str
    folder: Path
    label: str = ""

    @property
    def title(self) -> str:
        """Its name in the tables: the data set's, or its own folder's."""
        if self._own:
            return self.folder.name + self.label
        return datasets.DATASETS[self.dataset].origin.title.partition(",")[0] + self.label

    @property
    def names(self) -> tuple[str, ...]:
        """The title, and other names that the paper's own numbers may use."""
        return (self.title,) if self._own else (self.title, self.dataset + self.label)

    @property
    def pairs(self) -> list[tuple[str, str]]:
        """The first of its traverses against each other; none if it has no choice, or not two."""
        if self._own:
            return []
        first, *others = datasets.traverses(self.dataset, self.folder) or [""]
        return [(first, other) for other in others]

    def has(self, pair: tuple[str, str]) -> bool:
        """Whether both traverses are there, or ready matrices of the two."""
        there = datasets.traverses(self.dataset, self.folder)
        if all(
            name in there or (self.dataset in BY_POSITION and (self.folder / name).is_dir())
            for name in pair
        ):
            return True
        return any((self.folder / MATRICES / "_to_".join(pair)).glob("*.npy"))

    @property
    def _own(self) -> bool:
        return self.dataset in ("folders", MATRICES)


def read_pairs(texts: Sequence[str]) -> dict[str, list[tuple[str, str]]]:
    """The pairs of traverses that ``DATASET=REFERENCE/QUERY`` asks for, by data set.

    Raises
    ------
    SurefixValueError
        For another form, or a data set whose traverses cannot be chosen.
    """
    known = [
        name
        for name, dataset in datasets.DATASETS.items()
        if {"reference", "query"} <= set(dataset.options)
    ]
    chosen: dict[str, list[tuple[str, str]]] = {}
    for text in texts:
        name, _, pair = text.partition("=")
        dataset = name.strip().lower().replace("-", "_")
        reference, _, query = pair.partition("/")
        if not reference or not query or "/" in query or reference == query:
            raise mismatch("--pair", "DATASET=REFERENCE/QUERY, two traverses", repr(text))
        if dataset not in known:
            raise mismatch("--pair", f"one of {', '.join(known)} before the =", repr(name))
        if (reference, query) not in chosen.setdefault(dataset, []):
            chosen[dataset].append((reference, query))
    return chosen


def check_pairs(
    folder: Path, there: Sequence[Found], chosen: dict[str, list[tuple[str, str]]]
) -> None:
    """Looks for the pairs of ``read_pairs`` among the data sets that are there, before any is
    loaded.

    Raises
    ------
    SurefixValueError
        For a data set or a traverse that is not there.
    """
    for dataset, pairs in chosen.items():
        places = [found for found in there if found.dataset == dataset]
        if not places:
            known = [found.dataset for found in there if found.dataset in datasets.DATASETS]
            listed = ", ".join(dict.fromkeys(known)) or "none"
            expected = f"a data set that is there ({listed} in {folder})"
            raise mismatch("--pair", expected, dataset)
        for pair in pairs:
            if not any(found.has(pair) for found in places):
                listed = "; ".join(
                    f"{', '.join(datasets.traverses(dataset, found.folder)) or 'none'} in "
                    f"{found.folder}"
                    for found in places
                )
                expected = f"traverses that are there ({listed})"
                raise mismatch(f"--pair {dataset}", expected, "/".join(pair))


def find_datasets(folder: Path) -> list[Found]:
    """The data sets in a folder and in the folders right below it.

    Raises
    ------
    SurefixFileError
        If the folder does not exist.
    """
    if not folder.is_dir():
        raise SurefixFileError(f"{folder}: no such folder (--data: the folder with the data sets)")
    try:
        below = sorted(path for path in folder.iterdir() if path.is_dir())
        top = _looks_like(folder)
        # A data set found at the top is not found once more in its own parts; matrices have none.
        if top is not None and top.dataset != MATRICES:
            return [top]
        candidates = [found for place in (folder, *below) if (found := _looks_like(place))]
    except OSError as error:
        raise refusal(error.filename, "cannot list the folder", error) from None
    # A title of its own for each, from its folder's name, and a number if that is not enough.
    titles = [stem(found.title) for found in candidates]
    told: list[Found] = []
    for found, title in zip(candidates, titles, strict=True):
        several = titles.count(title) > 1 and found.title != found.folder.name
        label = f" ({found.folder.name})" if several else ""
        one, number = replace(found, label=label), 1
        while stem(one.title) in [stem(other.title) for other in told]:
            number += 1
            one = replace(found, label=f"{label} {number}")
        told.append(one)
    return told


# The names of a pair, the options of its loader, and the folders of its matrices with notes.
_Pair: TypeAlias = tuple[tuple[str, ...], dict[str, str], Mapping[Path, tuple[str, ...]]]


def load_cases(
    found: Found, chosen: Sequence[tuple[str, str]] = ()
) -> tuple[Sequence[Case], Sequence[str]]:
    """The cases of each pair of its traverses, SAD first and then its ready matrices; and the
    reasons why some could not be used.

    Matrices are in ``matrices/``, or those of one of several pairs in
    ``matrices/REFERENCE_to_QUERY/``.

    Parameters
    ----------
    found : Found
    chosen : sequence of (reference, query)
        These pairs alone; by default the first traverse against each other.
    """
    matrices = found.folder / MATRICES
    try:
        pairs = list(chosen) or found.pairs
    except OSError as error:
        return [], [str(error)]
    if not pairs:
        # Its loader names the missing folder, if any.
        return _load(found, (found.names, {}, {matrices: ()}))
    jobs: list[_Pair] = []
    for number, (reference, query) in enumerate(pairs):
        which = f"{reference.removeprefix('recording_')} to {query.removeprefix('recording_')}"
        names = tuple(f"{name}, {which}" for name in found.names)
        ready: dict[Path, tuple[str, ...]] = {}
        if number == 0:
            ready[matrices] = (f"The matrix lies in matrices/ itself: taken to be of {which}.",)
        if len(pairs) == 1:
            names = names + found.names if chosen else found.names + names
            ready[matrices] = ()
        ready[matrices / f"{reference}_to_{query}"] = ()
        jobs.append((names, {"reference": reference, "query": query}, ready))
    loaded = [*mapped(_load, found, jobs)]
    return [case for cases, _ in loaded for case in cases], [
        problem for _, problems in loaded for problem in problems
    ]


def _load(found: Found, pair_: _Pair) -> tuple[list[Case], list[str]]:
    """The cases of a pair: of its images, and of matrices in folders, each with its notes."""
    names, options, ready = pair_
    cases: list[Case] = []
    problems: list[str] = []
    known: tuple[Truth, float] | None = None
    if found.dataset == "folders":
        there = (found.folder / TRUTH).is_file()
        options = {"truth": TRUTH if there else "identity"}
    if found.dataset != MATRICES:
        try:
            pair = datasets.load(found.dataset, found.folder, **options)
            truth, tolerance = known = _truth(pair)
            D = sad_distances(pair.references, pair.queries)
            source, notes = f"images in {found.folder}", tuple(pair.notes)
            cases.append(Case(names[0], SAD, D, truth, tolerance, source, notes, names[1:]))
        except SurefixError as error:
            problems.append(str(error))
    for folder, notes in ready.items():
        for path in sorted(folder.glob("*.npy")):
            taken = [stem(case.technique) for case in cases]
            try:
                cases.append(_matrix(found, path, names, known, notes, taken))
            except SurefixError as error:
                problems.append(str(error))
    return cases, list(dict.fromkeys(problems))


def _matrix(
    found: Found,
    path: Path,
    names: tuple[str, ...],
    known: tuple[Truth, float] | None,
    notes: tuple[str, ...],
    taken: Sequence[str],
) -> Case:
    word = next((word for word in ("similarity", "distance") if f"_{word}" in path.stem), None)
    if word is None:
        raise SurefixFileError(
            f"{path}: expected NAME_similarity*.npy or NAME_distance*.npy, to tell which it holds"
        )
    technique = path.stem.partition(f"_{word}")[0]
    if stem(technique) in taken:
        technique = path.stem
    if stem(technique) in taken:
        raise mismatch(path, "names that differ in letters or digits", "another such")
    similarity = word == "similarity"
    D = read_matrix(path, similarity)
    (places, queries), file = D.shape, found.folder / TRUTH
    # Without the images, a matrix needs a truth of its own.
    if known is not None:
        truth, tolerance = known
    elif file.is_file():
        truth, tolerance = read_truth(file, places, queries), 1
    elif found.dataset in BY_POSITION:
        why = "without the images' positions there is no truth"
        raise SurefixFileError(f"{path}: expected {file}, as {why}")
    elif places != queries:
        why = f"{places} places and {queries} queries cannot be paired one to one"
        raise SurefixFileError(f"{path}: expected {file}, as {why}")
    else:
        truth, tolerance, notes = np.arange(queries, dtype=np.int64), 1, (*notes, IDENTITY)
    source = f"ready {kind(similarity)}, {path}"
    return Case(names[0], technique, D, truth, tolerance, source, notes, names[1:])


def _truth(pair: datasets.Pair) -> tuple[Truth, float]:
    if pair.truth is not None and not (pair.truth >= 0).any():
        raise mismatch(pair.name, "a query with a true place", f"{len(pair.truth)} without")
    if pair.reference_positions is not None and pair.query_positions is not None:
        return (pair.reference_positions, pair.query_positions), METRES
    if pair.truth is None:
        raise SurefixFileError(f"{pair.name}: expected a truth, got none")
    return pair.truth, 1


def _looks_like(folder: Path) -> Found | None:
    signs = {name: dataset.signs for name, dataset in datasets.DATASETS.items()}
    for name, patterns in (signs | {MATRICES: (f"{MATRICES}/*.npy",)}).items():
        if any(any(folder.glob(pattern)) for pattern in patterns):
            return Found(name, folder)
    return None
