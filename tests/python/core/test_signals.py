"""Ctrl-C in the midst of each long call, and in the code of objects that calls are given."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import surefix
from surefix.simulate import Route

# Calls of half a second and more, each of which gets SIGINT in its midst. A line says how each one ended.
CALLS = """
import os, signal, sys, threading, time
import numpy as np
import surefix
from surefix.post import Pca, fit
from surefix.simulate import Route

random = np.random.default_rng(0)
rows = lambda count, dim: random.standard_normal((count, dim), dtype=np.float32)
D = rows(2000, 2000)
descriptors = rows(4000, 512)
route = surefix.Map.from_descriptors(descriptors, metric="euclidean")
queries = np.concatenate([descriptors] * 20)
found = surefix.match_distances(D[:50], sequence_length=1)
truth = np.arange(2000) % 50
evaluation, other = (surefix.evaluate(found, truth, tolerance=each) for each in (1, 2))
many = surefix.match_distances(np.tile(D[:4], (1, 200)), sequence_length=1)
matches = surefix.Matches(place=np.arange(400_000) % 100_000, score=D.ravel()[:400_000])
dim = {"sequence_length": 300, "speeds": [0.8, 0.9, 1, 1.1, 1.2]}
longer = np.tile(D, (1, 8))
positions = rows(100_000, 2) * 1e6, rows(400_000, 2) * 1e6
references = rows(2200, 2200)
drive = Route(places=60_000, size=(64, 48)).traverse()
calls = {
    "match_distances": lambda: surefix.match_distances(D, **dim),
    "match_distances, motion": lambda: surefix.match_distances(longer, motion="any"),
    "match_distances, fused": lambda: surefix.match_distances([D, D], **dim),
    "match": lambda: surefix.match(route, queries, progress=False),
    "match, floor": lambda: surefix.match(route, queries, floor="global", progress=False),
    "align": lambda: surefix.align(longer, progress=False),
    "audit": lambda: surefix.audit(longer, progress=False),
    "auc_interval": lambda: evaluation.auc_interval(0.9, samples=3_000_000),
    "auc_difference_interval": lambda: evaluation.auc_difference_interval(other, 0.9, samples=3_000_000),
    "calibrate": lambda: surefix.calibrate(many, np.arange(400_000) % 4, block=None),
    "evaluate": lambda: surefix.evaluate(matches, positions),
    "from_images": lambda: surefix.Map.from_images(drive, progress=False),
    "pca": lambda: fit(references, [Pca(dim=64)]),
}
for name in sys.argv[1:] or calls:
    begun, how = time.monotonic(), None
    threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT)).start()
    try:
        calls[name]()
        how = "ended by itself"
        for _ in range(600):
            time.sleep(0.1)
    except KeyboardInterrupt:
        how = "interrupted" if how is None else how
    print(f"{name}: {how}, {time.monotonic() - begun - 0.1:.3f} s after the signal", flush=True)
"""


def test_each_long_call_ends_with_keyboard_interrupt() -> None:
    """A call that does not look at signals ends by itself, or not within the limit."""
    command = [sys.executable, "-c", CALLS]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    lines = done.stdout.splitlines()
    assert done.returncode == 0, done.stderr
    assert len(lines) >= 13
    assert not [line for line in lines if ": interrupted," not in line]


ROWS = np.random.default_rng(0).standard_normal((20, 16), dtype=np.float32)
MAP = surefix.Map.from_descriptors(ROWS)
IMAGES = np.random.default_rng(0).integers(0, 255, (4, 48, 96), np.uint8)


def raising(error: BaseException, *doors: str) -> Any:
    """An object that raises in some of its special methods, or attributes."""

    def door(*_: Any, **__: Any) -> Any:
        raise error

    methods: dict[str, Any] = {
        name: door if name.startswith("__") else property(door) for name in doors
    }
    return type("Raising", (), methods)()


def sequence(error: BaseException) -> Any:
    """Images that are asked for one by one, on several threads."""

    def item(_: Any, index: int) -> Any:
        if index == 2:
            raise error
        return IMAGES[index]

    return type("Images", (), {"__len__": lambda _: len(IMAGES), "__getitem__": item})()


def describer(error: BaseException) -> Any:
    def describe(_: Any, __: Any) -> Any:
        raise error

    recipe = {"name": "mine"}
    return type("Mine", (), {"name": "mine", "recipe": recipe, "describe": describe})()


def told(error: BaseException) -> Any:
    def progress(_: int, __: int) -> None:
        raise error

    return progress


# How each door is reached, with the error that is raised in it.
DOORS: dict[str, Any] = {
    "push, __array__": lambda e: surefix.Localizer(MAP).push(raising(e, "__array__")),
    "push, __dlpack__": lambda e: surefix.Localizer(MAP).push(raising(e, "__dlpack__")),
    "push, __fspath__": lambda e: surefix.Localizer(MAP).push(raising(e, "__fspath__")),
    "push, hasattr": lambda e: surefix.Localizer(MAP).push(
        type("Odd", (), {"__getattr__": lambda _, __: (_ for _ in ()).throw(e)})()
    ),
    "push, __float__": lambda e: surefix.Localizer(MAP).push(
        ROWS[0], advance=raising(e, "__float__")
    ),
    "push, in a list": lambda e: surefix.Localizer(MAP).push([raising(e, "__array__")] * 16),
    "stream, __iter__": lambda e: surefix.Localizer(MAP).stream(raising(e, "__iter__")),
    "stream, gap": lambda e: list(
        surefix.Localizer(MAP).stream(
            [
                type(
                    "F",
                    (),
                    {"image": 1, "gap": False, "dropped": raising(e, "__index__")},
                )()
            ]
        )
    ),
    "match, __array__": lambda e: surefix.match(MAP, raising(e, "__array__", "__len__")),
    "match, rows": lambda e: surefix.match(MAP, [raising(e, "__array__")] * 3),
    "match, several maps": lambda e: surefix.match([MAP, MAP], [raising(e, "__array__")] * 2),
    "match_distances, __array__": lambda e: surefix.match_distances(raising(e, "__array__")),
    "match_distances, several": lambda e: surefix.match_distances([raising(e, "__array__")] * 2),
    "Map.distances": lambda e: MAP.distances(raising(e, "__array__")),
    "from_descriptors": lambda e: surefix.Map.from_descriptors(raising(e, "__array__")),
    "from_images, __len__": lambda e: surefix.Map.from_images(raising(e, "__len__", "__getitem__")),
    "from_images, __getitem__": lambda e: surefix.Map.from_images(sequence(e), progress=False),
    "from_images, skip_bad": lambda e: surefix.Map.from_images(
        sequence(e), progress=False, skip_bad=True
    ),
    "from_images, __iter__": lambda e: surefix.Map.from_images(raising(e, "__iter__")),
    "from_images, paths": lambda e: surefix.Map.from_images([raising(e, "__fspath__")] * 2),
    "from_images, progress": lambda e: surefix.Map.from_images(IMAGES, progress=told(e)),
    "from_images, describe": lambda e: surefix.Map.from_images(
        IMAGES, descriptor=describer(e), progress=False
    ),
    "positions": lambda e: surefix.Map.from_descriptors(ROWS, positions=raising(e, "__array__")),
    "names": lambda e: surefix.Map.from_descriptors(ROWS, names=raising(e, "__iter__")),
    "join": lambda e: surefix.Map.join(raising(e, "__iter__")),
    "an option": lambda e: surefix.Matcher(20, tolerance=raising(e, "__index__")),
    "an option's words": lambda e: surefix.Matcher(20, tolerance=raising(e, "__repr__")),
    "speeds": lambda e: surefix.Matcher(20, speeds=raising(e, "__iter__")),
    "places": lambda e: surefix.Matcher(raising(e, "__index__")),
    "advance": lambda e: surefix.match_distances(ROWS, advance=raising(e, "__array__")),
    "gaps": lambda e: surefix.match_distances(ROWS, gaps=raising(e, "__array__")),
    "evaluate": lambda e: surefix.evaluate(raising(e, "place"), np.zeros(3, int)),
    "align, at": lambda e: surefix.align(ROWS, at=raising(e, "__iter__")),
    "legs": lambda e: Route(places=10).traverse(legs=[("drive", raising(e, "__index__"))]),
}


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize("raised", [KeyboardInterrupt, SystemExit, MemoryError])
def test_what_is_no_refusal_stays_itself(door: str, raised: type[BaseException]) -> None:
    error = raised("mine")
    with pytest.raises(raised) as caught:
        DOORS[door](error)
    assert caught.value is error
