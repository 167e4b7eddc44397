"""A case: the distances of one technique on one data set with the truth, and the settings that all
cases share; cases from ready matrices, from images, and from the generated route.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from surefix._core import Map, Sad, read_image
from surefix._ray import mapped
from surefix.baselines import Context
from surefix.baselines.distances import Distances
from surefix.baselines.truth import Truth
from surefix.datasets import Images
from surefix.errors import SurefixValueError, mismatch
from surefix.simulate import Route
from surefix.study import Recall, Study
from surefix.study.study import found_by
from surefix.tables.matrices import read_matrix
from surefix.tables.npy import read_npy

__all__ = [
    "Case",
    "Settings",
    "generated_cases",
    "kind",
    "matrix_case",
    "run_cases",
    "sad_distances",
]

# The paper's weight and length.
WEIGHT = 0.99
LENGTH = 2
SAD = "SAD"
# Metres to the side of the mapped lane: there the nearest place is seldom the right one.
OTHER_LANE = 1.5
IDENTITY = "No truth was given: query i is taken to show place i."


@dataclass(frozen=True)
class Settings:
    """The settings of every exhibit.

    Parameters
    ----------
    recall : {"correct", "place_exists", "rejected"}
        As for ``surefix.evaluate``.
    quick : bool
        Fewer bootstrap samples, fewer weights, smaller maps: to see that all works, not to quote.
    """

    recall: Recall = "correct"
    quick: bool = False

    @property
    def samples(self) -> int:
        """Bootstrap samples of an interval in a table."""
        return 100 if self.quick else 2000

    @property
    def band_samples(self) -> int:
        """Bootstrap samples of each of the many intervals along a curve."""
        return 20 if self.quick else 200

    @property
    def draws(self) -> int:
        """Draws of a predictor with set rates."""
        return 2 if self.quick else 10


@dataclass(frozen=True, eq=False)
class Case:
    """The distances of one technique on one data set.

    Parameters
    ----------
    dataset, technique : str
    D : array of float32, shape (n, m)
        Less is more alike.
    truth, tolerance
        As for ``surefix.evaluate``.
    source : str
        The origin of the distances, in a few words.
    notes : tuple of str
        Anything that was left out or assumed.
    aliases : tuple of str
        Other names of the data set that the paper's own numbers may use.
    generated : bool
        No camera took these images.
    """

    dataset: str
    technique: str
    D: Distances
    truth: Truth
    tolerance: float = 1
    source: str = ""
    notes: tuple[str, ...] = ()
    aliases: tuple[str, ...] = ()
    generated: bool = False
    _studies: dict[Settings, Study] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        places, queries = self.D.shape
        if places < 10 or queries < 10:
            got = f"{places} and {queries}"
            raise mismatch(self.name, "at least 10 places and 10 queries", got)
        study = self.study(Settings())
        try:
            _ = study.baseline.curve, study.single_right
        except SurefixValueError as error:
            raise SurefixValueError(f"{self.name}, {error}") from None

    @property
    def name(self) -> str:
        """For titles and legends."""
        return f"{self.dataset}, {self.technique}"

    def study(self, settings: Settings) -> Study:
        """The plain and the weighted sequence on these distances: the same study each time."""
        if settings not in self._studies:
            context = Context(LENGTH, WEIGHT, truth=self.truth, truth_tolerance=self.tolerance)
            self._studies[settings] = Study(self.D, context, settings.recall, settings.samples)
        return self._studies[settings]


def run_cases(cases: Sequence[Case], settings: Settings) -> None:
    """The results and their intervals of all cases, each made by a task of its own."""
    jobs = [(at, name, settings) for at, c in enumerate(cases) for name in c.study(settings).names]
    for (at, name, _), found in zip(jobs, mapped(_found, cases, jobs), strict=True):
        cases[at].study(settings).take(name, *found)


def _found(cases: Sequence[Case], job: tuple[int, str, Settings]) -> tuple[Any, Any, Any]:
    at, name, settings = job
    return found_by(cases[at].study(settings), name)


def generated_cases(settings: Settings) -> Sequence[Case]:
    """The generated route, driven again in winter, and driven again a lane further to the side."""
    places, size = (150, (96, 48)) if settings.quick else (1000, (160, 80))
    route = Route(places=places, size=size, seed=1)
    reference = route.reference()
    cases = []
    for name, drive in (
        ("generated winter", route.revisit()),
        ("generated other lane", route.revisit(lateral_offset=OTHER_LANE)),
    ):
        D = sad_distances(reference, drive)
        source = (
            f"generated by surefix.simulate, {places} places, seed 1, {size[0]} x {size[1]} pixels"
        )
        cases.append(Case(name, SAD, D, drive.truth(reference), source=source, generated=True))
    return cases


def sad_distances(references: Any, queries: Any) -> Distances:
    """The distances of SAD, float32 (n, m), from images, paths or traverses."""
    references, queries = (
        # The files of a data set's images, if it has files.
        images.paths if isinstance(images, Images) and images.paths is not None else images
        for images in (references, queries)
    )
    sad = Sad()
    known = Map.from_images(references, sad, progress=False)
    D = np.empty((len(known), len(queries)), np.float32, order="F")
    for query in range(len(queries)):
        image = queries[query]
        pixels = read_image(image) if isinstance(image, str) else image
        D[:, query] = known.distances(sad.describe(pixels))
    return D


def matrix_case(text: str, *, similarity: bool = False) -> Case:
    """A case from ``NAME=FILE.npy`` or ``NAME=FILE.npy,TRUTH.npy``.

    Parameters
    ----------
    text : str
        ``NAME`` is ``DATASET/TECHNIQUE``, or a technique alone. The matrix has a row a place and a
        column a query. The truth is as for ``surefix.evaluate``, (m,) or (n, m); without one, the
        matrix must be square, and query ``i`` shows place ``i``.
    similarity : bool
        More is more alike: the distance is 1 minus that.

    Raises
    ------
    SurefixError
        For another form, a file that cannot be read, or arrays that do not fit each other.
    """
    name, equals, files = text.partition("=")
    if not (name and equals and files):
        raise mismatch("--matrix", "NAME=FILE.npy or NAME=FILE.npy,TRUTH.npy", repr(text))
    file, _, truth_file = files.partition(",")
    dataset, slash, technique = name.partition("/")
    if not slash:
        dataset, technique = Path(file).resolve().parent.name or "matrix", name
    D = read_matrix(Path(file), similarity)
    notes: tuple[str, ...] = ()
    truth: Truth
    if truth_file:
        truth = read_npy(Path(truth_file), "the truth")
    elif D.shape[0] == D.shape[1]:
        truth = np.arange(D.shape[1], dtype=np.int64)
        notes = (IDENTITY,)
    else:
        raise SurefixValueError(
            f"--matrix {name}: expected FILE.npy,TRUTH.npy, as {D.shape[0]} places and "
            f"{D.shape[1]} queries cannot be paired one to one"
        )
    return Case(dataset, technique, D, truth, 1, f"ready {kind(similarity)}, {file}", notes)


def kind(similarity: bool) -> str:
    """The kind of numbers in a matrix."""
    return "similarities" if similarity else "distances"
