"""The answers of an installed wheel, a line each with a digest of every bit. They must be the same
on two processors.

``python packaging/answers.py`` needs surefix and numpy, and no other file: it runs on every machine
that runs the wheel. Inputs are whole numbers and exact fractions, so that they are the same
everywhere.
"""

import hashlib
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import surefix
from surefix.simulate import Route

PLACES = 300
# Prime, so that every kernel ends on a remainder that is shorter than its registers.
DIM = 509
ELEMENTS = ("float32", "float16", "int8", "uint8")
METRICS = ("manhattan", "euclidean", "cosine")
OPTIONS = (
    {},
    {"sequence_length": 20, "floor": "global", "weight": 0.5},
    {"sequence_length": 7, "speeds": (0.5, 1.0, 2.0)},
    {"smoothing": 1, "tolerance": 3},
)


def main() -> None:
    """Prints them."""
    print(f"surefix {surefix.__version__}")
    for name, arrays in answers():
        digest = hashlib.sha256()
        for array in arrays:
            digest.update(f"{array.dtype} {array.shape}".encode())
            digest.update(np.ascontiguousarray(array).tobytes())
        print(f"{digest.hexdigest()[:32]} {name}")
        sys.stdout.flush()


def answers() -> Iterator[tuple[str, tuple[np.ndarray, ...]]]:
    """The name of each computation, and its arrays."""
    route = Route(places=PLACES, size=(128, 64), seed=3)
    reference, revisit = route.reference(), route.revisit()
    yield (
        "generated route",
        tuple(drive[index] for drive in (reference, revisit) for index in (0, 150, PLACES - 1)),
    )
    for dtype in ("u8", "f32"):
        known = surefix.Map.from_images(reference, surefix.Sad(dtype=dtype))
        yield f"sad {dtype}: descriptors", (known.descriptors,)
        for number, options in enumerate(OPTIONS):
            run = surefix.match(known, revisit, **options)
            yield f"sad {dtype}: match, options {number}", columns(run)
            truth = np.arange(len(run))
            ev = surefix.evaluate(run, truth, tolerance=2)
            area = np.array([ev.auc(0.2), ev.max_recall])
            yield (
                f"sad {dtype}: evaluation, options {number}",
                (ev.precision, ev.recall, ev.thresholds, area),
            )
        yield f"sad {dtype}: stream", stream(known, revisit)
    for element in ELEMENTS:
        rows, queries = vectors(element, PLACES), vectors(element, 40, seed=2)
        for metric in METRICS:
            known = surefix.Map.from_descriptors(rows, metric=metric)
            distances = np.stack([known.distances(query) for query in queries], axis=1)
            yield f"{element} {metric}: distances", (distances,)
            yield (
                f"{element} {metric}: match",
                columns(surefix.match_distances(distances, floor="global")),
            )
    # A screen has no bound for the manhattan distance.
    for metric in ("euclidean", "cosine"):
        known = surefix.Map.from_descriptors(vectors("float32", PLACES), metric=metric, screen="i8")
        yield (
            f"float32 {metric}: match by the screen",
            columns(surefix.match(known, vectors("float32", 40, seed=2))),
        )


def vectors(element: str, count: int, seed: int = 1) -> np.ndarray:
    """Descriptors that change slowly, as a camera's do: neighbours are alike."""
    steps = np.random.default_rng(seed).integers(-40, 41, size=(count, DIM))
    walk = np.cumsum(steps, axis=0) % 251 - 125
    if element == "uint8":
        return (walk + 125).astype(np.uint8)
    return walk.astype(np.int8) if element == "int8" else (walk / 128).astype(element)


def columns(run: surefix.Run) -> tuple[np.ndarray, ...]:
    """All columns of a run."""
    names = (
        "place",
        "score",
        "trusted",
        "ready",
        "anchors",
        "speed",
        "single_place",
        "single_distance",
    )
    return tuple(getattr(run, name) for name in (*names, "gradient_place", "gradient_value"))


def stream(known: surefix.Map, drive: surefix.simulate.Traverse) -> tuple[np.ndarray, ...]:
    """Places and scores of a localizer that is stopped half way and restored, with its map saved
    and opened again.
    """
    localizer = surefix.Localizer(known, sequence_length=5)
    fixes = [localizer.push(drive[index]) for index in range(PLACES // 2)]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "route.safetensors"
        known.save(file)
        opened = surefix.Map.open(file)
    localizer = surefix.Localizer.restore(opened, localizer.snapshot())
    fixes += [localizer.push(drive[index]) for index in range(PLACES // 2, PLACES)]
    return np.array([fix.place for fix in fixes]), np.array([fix.score for fix in fixes])


if __name__ == "__main__":
    main()
