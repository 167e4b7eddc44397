"""Maps of several blocks, drives along them, and what one machine answers."""

import pickle
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import surefix

BLOCK = 4096
PLACES = 8 * BLOCK + 900
DIM = 8
# Segments that the borders of shards cut, open and closed.
SEGMENTS = surefix.Segments(PLACES, [3000, 9000, 20000], [1, 3], [(2000, 15000)])


def road(segments: surefix.Segments = SEGMENTS) -> surefix.Map:
    """A map of noise along a smooth road, with positions."""
    rng = np.random.default_rng(1)
    rows = np.cumsum(rng.standard_normal((PLACES, DIM)), axis=0) * 0.3
    rows += rng.standard_normal((PLACES, DIM)) * 0.5
    where = np.column_stack([np.arange(PLACES) * 2.0, np.zeros(PLACES)])
    route = surefix.Map.from_descriptors(
        rows.astype(np.float32), metric="euclidean", positions=where
    )
    return route.with_segments(segments)


def drive(route: surefix.Map, queries: int, seed: int = 0) -> list[dict[str, Any]]:
    """What ``push`` is given on a drive that jumps now and then, mostly with odometry."""
    rng = np.random.default_rng(seed)
    rows, at, pushed = route.descriptors, 0, []
    for number in range(queries):
        step = int(rng.integers(0, 3))
        if number % 90 == 0:
            # Near a border of blocks.
            at, step = int(rng.integers(1, 9)) * BLOCK - int(rng.integers(0, 60)), 0
        at = (at + step) % PLACES
        noise = rng.standard_normal(DIM) * 0.4
        advance = None if number % 30 < 6 else float(step) + 0.2 * float(rng.standard_normal())
        pushed.append({"frame": (rows[at] + noise).astype(np.float32), "advance": advance})
    return pushed


def bits(fix: surefix.Fix) -> bytes:
    return pickle.dumps(fix) + repr(fix.position).encode()


def alone(route: surefix.Map, drive: Sequence[dict[str, Any]], **options: Any) -> list[bytes]:
    """The answers of one machine."""
    localizer = surefix.Localizer(route, **options)
    return [bits(localizer.push(**pushed)) for pushed in drive]


def saved(folder: Path, route: surefix.Map) -> Path:
    route.save(folder / "road.safetensors")
    return folder / "road.safetensors"
