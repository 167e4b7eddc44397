"""``surefix bench``: how fast a push and the scan are on this machine."""

import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import cycle, islice
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
import typer

from surefix import Localizer, Map, Matcher, Sad
from surefix._core import instruction_set
from surefix._terminal import Console, say
from surefix.cli.flags import documented
from surefix.machine import machine

QUANTILES = {"p50": 0.5, "p99": 0.99, "p99.9": 0.999, "max": 1.0}
# By default, the pushes of about 5 seconds, within these limits.
SECONDS, FEWEST, MOST = 5.0, 200, 100_000
# Different queries, pushed in turn.
QUERIES = 32
# More memory is read no slower.
LARGEST = 1 << 30


Numbers = Literal["u8", "i8", "f16", "f32"]


@documented
def bench(
    map_file: Annotated[Path | None, typer.Argument(metavar="MAP")] = None,
    places: Annotated[int, typer.Option("--places", "-n", min=2)] = 1800,
    dim: Annotated[int, typer.Option(min=1)] = 2048,
    dtype: Numbers = "u8",
    sequence_length: Annotated[int, typer.Option("--sequence-length", "-L", min=1)] = 2,
    threads: Annotated[int | None, typer.Option(min=1)] = None,
    pushes: Annotated[int | None, typer.Option(min=1)] = None,
    image: bool = False,
) -> None:
    """Measure how fast a push and the scan are on this machine.

    Parameters
    ----------
    map_file: A map file; a random map without it.
    places: Places on the random map.
    dim: Numbers of each of its rows.
    dtype: Their type.
    sequence_length: Queries a sequence.
    threads: Threads of the scan; by default chosen by size.
    pushes: Pushes to time; by default those of 5 seconds.
    image: Push 640 x 480 RGB images; the map is one of SAD.
    """
    rng = np.random.default_rng(1)
    with Console(stderr=True, force_terminal=sys.stderr.isatty()).status("Preparing the map"):
        known = Map.open(map_file) if map_file else _random_map(rng, places, dim, dtype, image)
        places = len(known)
        columns = list(rng.random((QUERIES, places), np.float32))
        pixels = (QUERIES, 480, 640, 3)
        frames = list(rng.integers(0, 256, pixels, np.uint8)) if image else _queries(rng, known)
        localizer = Localizer(known, threads=threads, sequence_length=sequence_length)
        matcher = Matcher(places, sequence_length=sequence_length)
    size = known.descriptors.nbytes
    say(f"{machine()}, {instruction_set()}")
    say(
        f"{places:,} places x {known.dim:,} {known.dtype}, {known.metric}, {size / 1e6:,.1f} MB; "
        f"L = {sequence_length}, {localizer.threads} thread{'s' * (localizer.threads > 1)}"
    )
    with Console(stderr=True, force_terminal=sys.stderr.isatty()).status("Pushing"):
        name = "image to fix" if image else "descriptor to fix"
        say(f"{'':<20}" + "".join(f"{quantile:>12}" for quantile in QUANTILES) + "      pushes")
        say(_row(name, timed(localizer.push, frames, pushes, sequence_length)))
        say(_row("distances to fix", timed(matcher.push, columns, pushes, sequence_length)))
        if known.post is None:
            # One thread's scan: the whole column of distances, without a screen.
            scan = float(np.median(timed(known.distances, _queries(rng, known), pushes, 1)))
            speed = memory_speed(size)
            took = f"{size / scan:>9.1f} GB/s ({_duration(scan)})"
            say(f"scan on one thread  {took}; the memory gives {speed / 1e9:.1f} GB/s")


def timed(
    push: Callable[[Any], object], queries: Sequence[Any], pushes: int | None, warm_up: int
) -> npt.NDArray[np.int64]:
    """Nanoseconds of each push, called from Python one by one, once the window is full."""
    clock = time.perf_counter_ns
    following = cycle(queries)
    for query in islice(following, max(warm_up, len(queries))):
        push(query)
    if pushes is None:
        begin = clock()
        for query in islice(following, 8):
            push(query)
        pushes = round(SECONDS * 1e9 * 8 / max(1, clock() - begin))
        pushes = min(max(pushes, FEWEST), MOST)
    took = np.empty(pushes, np.int64)
    for index, query in zip(range(pushes), following, strict=False):
        begin = clock()
        push(query)
        took[index] = clock() - begin
    return took


def memory_speed(size: int, threads: int = 1, seconds: float = 0.3) -> float:
    """Bytes a second at which NumPy reads `size` bytes over and over, in the fastest round."""
    floats = np.ones(max(1024, min(size, LARGEST) // 4), np.float32)
    best = float("inf")
    with ThreadPoolExecutor(threads) as pool:
        parts = np.array_split(floats, threads)
        begin = time.perf_counter()
        while best == float("inf") or time.perf_counter() - begin < seconds:
            # The faster of the two depends on the processor.
            for read in (np.max, lambda part: np.dot(part, part)):
                start = time.perf_counter()
                list(pool.map(read, parts) if threads > 1 else [read(floats)])
                best = min(best, time.perf_counter() - start)
    return floats.nbytes / best


def _random_map(
    rng: np.random.Generator, places: int, dim: int, dtype: Numbers, image: bool
) -> Map:
    if image:
        small = rng.integers(0, 256, (places, 32, 64), np.uint8)
        return Map.from_images(small, Sad(), progress=False)
    metric = "manhattan" if dtype == "u8" else "euclidean"
    rows = _random(rng, (places, dim), np.dtype(dtype[0] + str(int(dtype[1:]) // 8)))
    return Map.from_descriptors(rows, metric=metric)


def _queries(rng: np.random.Generator, known: Map) -> list[Any]:
    """Rows from the middle of the map on with noise; if it has post-processing, random vectors."""
    if known.post is not None:
        return list(_random(rng, (QUERIES, known.input_dim), np.dtype(np.float32)))
    rows = known.descriptors[(np.arange(QUERIES) + len(known) // 2) % len(known)]
    noise = _random(rng, rows.shape, rows.dtype)
    return list(np.where(rng.random(rows.shape) < 0.3, noise, rows))


def _random(rng: np.random.Generator, shape: tuple[int, ...], dtype: Any) -> Any:
    if dtype.kind in "iu":
        return rng.integers(np.iinfo(dtype).min, np.iinfo(dtype).max, shape, dtype, endpoint=True)
    return rng.standard_normal(shape, np.float32).astype(dtype)


def _row(name: str, took: npt.NDArray[np.int64]) -> str:
    cells = "".join(f"{_duration(np.quantile(took, q)):>12}" for q in QUANTILES.values())
    return f"{name:<20}{cells}{len(took):>12,}"


def _duration(nanoseconds: float) -> str:
    for unit, size in (("s", 1e9), ("ms", 1e6), ("us", 1e3)):
        if nanoseconds >= size:
            return f"{nanoseconds / size:.3g} {unit}"
    return f"{nanoseconds:.0f} ns"
