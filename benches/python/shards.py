"""Measures `surefix.distributed` on this machine: what shards cost beside one `Localizer`.

The map is 1 million places x 2,048 bytes, in a file that is made in the system's folder for
temporary files and goes at the end. Each fix is compared with that of `Localizer`, bit for bit.
`--page` puts the tables into a page.
"""

import argparse
import os
import pickle
import signal
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np

from page import duration, replaced, table
from surefix import Localizer, Map, _core
from surefix._ray import Cluster
from surefix.distributed import ShardedLocalizer
from surefix.machine import processor

DIM = 2048
KINDS: dict[str, dict[str, Any]] = {
    "paper": {"sequence_length": 10},
    "steady": {"sequence_length": 10, "motion": "steady"},
    "free": {"sequence_length": 10, "motion": "free"},
}
SHARDS = (1, 2, 4, 8)
# A fleet's map: places, machines, cores of each.
FLEETS = ((10**7, 1, 32), (10**8, 10, 32), (10**9, 100, 32))
# Assumed: seconds there and back between machines of one data centre, and the bytes a second that
# the memory of one gives to all of its cores.
NETWORK = 0.2e-3
MEMORY = 200e9


def made(path: Path, places: int) -> None:
    """A map of random bytes."""
    rng = np.random.default_rng(1)
    rows = np.empty((places, DIM), np.uint8)
    for start in range(0, places, 1 << 14):
        rows[start : start + (1 << 14)] = rng.integers(
            0, 256, rows[start : start + (1 << 14)].shape
        )
    Map.from_descriptors(rows, metric="manhattan").save(path)


def driven(route: Map, queries: int) -> list[np.ndarray]:
    """Queries along the map, with noise."""
    rng = np.random.default_rng(2)
    start = len(route) // 3
    rows = route.slice(start, start + queries).descriptors.astype(np.int16)
    return [*np.clip(rows + rng.integers(-40, 41, rows.shape), 0, 255).astype(np.uint8)]


def pushes(push: Callable[[Any], Any], queries: Sequence[Any]) -> tuple[float, list[bytes]]:
    """The median time of a push, and the fixes."""
    times, fixes = [], []
    for query in queries:
        began = time.perf_counter()
        fix = push(query)
        times.append(time.perf_counter() - began)
        fixes.append(pickle.dumps(fix))
    return statistics.median(times), fixes


def overheads(file: Path, queries: Sequence[Any]) -> Iterator[tuple[str, ...]]:
    """A row for each kind: one machine, and each number of shards."""
    route = Map.open(file, mmap=True)
    for kind, options in KINDS.items():
        alone, wanted = pushes(Localizer(route, threads=1, **options).push, queries)
        both, _ = pushes(Localizer(route, threads=2, **options).push, queries)
        row = [kind, duration(alone), duration(both)]
        for shards in SHARDS:
            with ShardedLocalizer(file, shards=shards, **options) as localizer:
                seconds, fixes = pushes(localizer.push, queries)
            if fixes != wanted:
                raise SystemExit(f"{kind}, {shards} shards: not the fixes of one machine")
            row.append(duration(seconds))
        yield tuple(row)


def wire(file: Path, queries: Sequence[Any], shards: int) -> Iterator[tuple[str, ...]]:
    """A row for each kind and stage: the bytes to all shards and back, the mean of a query."""
    route = Map.open(file, mmap=True)
    for kind, options in KINDS.items():
        driver = _core.ShardDriver(route, shards, **options)
        held = [_core.Shard(route, index, shards, **options) for index in range(shards)]
        sums: dict[str, list[int]] = {}
        for query in queries:
            step = driver.push(query)
            while isinstance(step, tuple):
                stage, messages = step
                answers = [
                    getattr(shard, stage)(message)
                    for shard, message in zip(held, messages, strict=True)
                ]
                there, back = (sum(map(len, part)) for part in (messages, answers))
                old = sums.setdefault(stage, [0, 0])
                sums[stage] = [old[0] + there, old[1] + back]
                step = driver.answer(answers)
        for stage, (there, back) in sums.items():
            mean = [f"{part / len(queries):,.0f}" for part in (there, back)]
            yield kind, stage, *mean


def recoveries(file: Path, queries: Sequence[Any], ray: Any) -> Iterator[tuple[str, ...]]:
    """A row for each way to die: the push that notices it, beside the usual one."""
    with ShardedLocalizer(file, shards=4, deadline=120.0, **KINDS["free"]) as localizer:
        usual, _ = pushes(localizer.push, queries)
        for name in ("killed by the system", "killed by Ray"):
            times = []
            for index in range(4):
                actor = localizer._remotes[index].actor
                if name == "killed by Ray":
                    ray.kill(actor, no_restart=False)
                else:
                    os.kill(ray.get(actor.process.remote()), signal.SIGKILL)
                times.append(pushes(localizer.push, queries[:1])[0])
                pushes(localizer.push, queries[:9])
            best, median, worst = min(times), statistics.median(times), max(times)
            yield name, duration(usual), duration(best), duration(median), duration(worst)


def together(file: Path, queries: Sequence[Any]) -> Iterator[tuple[str, ...]]:
    """A row for each number of drives, each in a thread of its own: fixes a second of all."""
    options = KINDS["steady"]
    route = Map.open(file, mmap=True)
    for count in (1, 2, 4):
        plain = rate([Localizer(route, threads=1, **options).push for _ in range(count)], queries)
        first = ShardedLocalizer(file, shards=2, **options)
        held = [first, *(first.another() for _ in range(count - 1))]
        try:
            sharded = rate([localizer.push for localizer in held], queries)
        finally:
            for localizer in held:
                localizer.close()
        yield str(count), f"{plain:.1f}", f"{sharded:.1f}"


def rate(each: Sequence[Callable[[Any], Any]], queries: Sequence[Any]) -> float:
    threads = [Thread(target=pushes, args=(push, queries)) for push in each]
    began = time.perf_counter()
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return len(each) * len(queries) / (time.perf_counter() - began)


class _Echo:
    def echo(self, message: bytes) -> bytes:
        return message


def constants(file: Path, queries: Sequence[Any], ray: Any) -> dict[str, float]:
    """What the model of latency is made of: seconds, and bytes a second."""
    route = Map.open(file, mmap=True)
    rows = len(route) * DIM
    free, _ = pushes(Localizer(route, threads=1, **KINDS["free"]).push, queries)
    least = Localizer(route, threads=1, sequence_length=1, smoothing=1)
    scan, _ = pushes(least.push, queries)
    actors = [ray.remote(_Echo).options(num_cpus=0).remote() for _ in range(8)]

    def call(count: int, size: int) -> float:
        times = []
        for _ in range(300):
            began = time.perf_counter()
            ray.get([actor.echo.remote(bytes(size)) for actor in actors[:count]])
            times.append(time.perf_counter() - began)
        return statistics.median(times[50:])

    one, all_of_them, large = call(1, 100), call(8, 100), call(1, 90_000)
    return {
        "scan": rows / scan,
        "method": max(free - scan, 0.0) / len(route),
        "call": one,
        "more": (all_of_them - one) / 7,
        "wire": 2 * 90_000 / max(large - one, 1e-9),
    }


def modelled(places: int, machines: int, cores: int, of: dict[str, float]) -> tuple[str, ...]:
    """The row of a fleet, a shard a machine: the time of a fix by the constants measured here, and
    those assumed.
    """
    own = places / machines
    scan = max(own / cores * DIM / of["scan"], own * DIM / MEMORY)
    work = scan + own / cores * of["method"]
    network = NETWORK if machines > 1 else 0.0
    sent = machines * cores * DIM / of["wire"]
    calls = 2 * (of["call"] + network + (machines - 1) * of["more"]) + sent
    return (
        f"{places:,}", f"{machines} x {cores}", f"{own * DIM / 1e9:,.1f} GB", duration(work),
        duration(calls), duration(work + calls),
    )  # fmt: skip


def tables(places: int, queries: int) -> Iterator[str]:
    """All of them, as Markdown."""
    with Cluster() as cluster, tempfile.TemporaryDirectory(prefix="surefix-bench-") as folder:
        file = Path(folder) / "map.safetensors"
        made(file, places)
        drive = driven(Map.open(file, mmap=True), queries)
        cores = len(os.sched_getaffinity(0))
        yield f"{places:,} places x {DIM:,} bytes, {cores} cores, {processor()}.\n"
        heads = (
            "a push",
            "one thread",
            "two threads",
            *(f"{n} shard{'s' * (n > 1)}" for n in SHARDS),
        )
        yield "Median of a push, `Localizer` beside shards (1 shard is an actor like any other):\n"
        yield table(heads, list(overheads(file, drive)))
        yield "Bytes of a query to all of 8 shards, and back:\n"
        yield table(("", "trip", "there", "back"), list(wire(file, drive, 8)))
        yield "A push after an actor of four has died, which brings it back:\n"
        heads = ("", "usual push", "best", "median", "worst")
        yield table(heads, list(recoveries(file, drive, cluster.ray)))
        yield "Fixes a second of several drives together, each in a thread of its own:\n"
        heads = ("drives", "`Localizer`, one thread", "on the same 2 shards")
        yield table(heads, list(together(file, drive)))
        of = constants(file, drive, cluster.ray)
        yield "The constants:\n"
        yield table(
            ("", ""),
            [
                ("scan, bytes a second and core", f"{of['scan'] / 1e9:.1f} GB/s"),
                ("tracker and sequence, a place", duration(of["method"])),
                ("call of an actor, there and back", duration(of["call"])),
                ("each further actor", duration(of["more"])),
                ("bytes of a message", f"{of['wire'] / 1e6:.0f} MB/s"),
            ],
        )
        yield "What they say of fleets, a shard with all cores of a machine:\n"
        heads = (
            "places",
            "machines x cores",
            "rows a machine",
            "scan and method",
            "calls",
            "a fix",
        )
        yield table(heads, [modelled(*fleet, of) for fleet in FLEETS])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--places", type=int, default=1_000_000)
    parser.add_argument("--queries", type=int, default=30)
    parser.add_argument("--page", type=Path)
    given = parser.parse_args()
    parts = []
    for part in tables(given.places, given.queries):
        print(part, flush=True)
        parts.append(part)
    if given.page:
        marks = [f"<!-- {which}: made by make shards -->" for which in ("begin", "end")]
        text = given.page.read_text(encoding="utf-8")
        given.page.write_text(replaced(text, "\n".join(parts), *marks), encoding="utf-8")


if __name__ == "__main__":
    main()
