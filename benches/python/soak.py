"""Soaks the library in Rust (`tests/soak`) and from Python: long drives on a map of 800 places.

A row for each kind of localizer; exit code 1 if a push called the allocator, if memory grew by a
megabyte, or if an answer differs. `--load` keeps all cores but the first busy, and drives the kinds
of one thread on the first. `--page` puts the table into a page.
"""

import argparse
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np

import surefix
from page import duration, replaced, table

HEADER = (
    "kind", "pushes", "allocator calls", "memory grew by", "p50", "p99", "p99.99", "longest",
    "fixes compared",
)  # fmt: skip
KINDS = ("plain", "screened", "two threads", "mapped", "tracker", "Python")
UNDER_LOAD = ("plain", "two threads", "tracker")
RUST = ("cargo", "test", "--locked", "--release", "--all-features", "--test", "soak")
# From reset to reset, and one in how many of these is compared with a batch.
LEG, COMPARED = 1000, 16
PLACES, DIM = 800, 64
BUSY = "while True: pass"


def in_rust(kind: str, pushes: int, cores: set[int] | None) -> tuple[tuple[str, ...], bool]:
    """The row of a kind, and whether it held."""
    environment = os.environ | {"PUSHES": str(pushes)}
    # Built on all cores, driven on some.
    subprocess.run([*RUST, "--quiet", "--no-run"], check=True)
    pinned = ("taskset", "-c", ",".join(map(str, sorted(cores)))) if cores else ()
    ran = subprocess.run(
        [*pinned, *RUST, "--quiet", "--", kind], env=environment, stdout=subprocess.PIPE, text=True
    )
    found = re.findall(r"^\| (.*) \|$", ran.stdout, re.MULTILINE)
    if len(found) != 1:
        raise SystemExit(f"{kind}: the soak ended with code {ran.returncode}, without a row")
    return tuple(found[0].split(" | ")), ran.returncode == 0


def resident() -> int:
    """Bytes of memory in use."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.partition("VmRSS:")[2].split()[0]) * 1024


def legs(pushes: int) -> Iterator[np.ndarray]:
    """Queries from reset to reset: along the map, with noise."""
    rng = np.random.default_rng(2)
    rows = from_map()
    at = 0
    for start in range(0, pushes, LEG):
        count = min(LEG, pushes - start)
        noise = rng.uniform(-0.5, 0.5, (count, DIM)).astype(np.float32)
        yield rows[(at + np.arange(count)) % PLACES] + noise
        at += count


def from_map() -> np.ndarray:
    return np.random.default_rng(1).uniform(-1, 1, (PLACES, DIM)).astype(np.float32)


def in_python(pushes: int) -> tuple[tuple[str, ...], bool]:
    """Pushes from Python, in this process. One leg in sixteen is compared with a batch."""
    options = {"sequence_length": 10, "speeds": (0.8, 1.0, 1.2)}
    route = surefix.Map.from_descriptors(from_map(), metric="euclidean")
    localizer = surefix.Localizer(route, threads=1, **options)
    # Its pages are in memory before the first look.
    times = np.full(pushes, 1, np.uint32)
    clock = time.perf_counter_ns
    compared = pushed = drift = 0
    same, first = True, 0
    for number, queries in enumerate(legs(pushes)):
        localizer.reset()
        fixes = []
        beside = number % COMPARED == 0
        for query in queries:
            began = clock()
            fix = localizer.push(query)
            times[pushed] = min(clock() - began, 2**32 - 1)
            pushed += 1
            if beside:
                fixes.append((fix.place, fix.score, fix.trusted))
        if beside:
            run = surefix.match(route, queries, **options)
            batch = list(
                zip(run.place.tolist(), run.score.tolist(), run.trusted.tolist(), strict=True)
            )
            same &= fixes == batch
            compared += len(fixes)
        if number % 100 == 1 or pushed == pushes:
            first = first or resident()
            drift = max(drift, resident() - first)
    ranks = np.percentile(times, [50, 99, 99.99, 100])
    row = (
        "Python", str(pushes), "not counted", f"{drift // 1024} KiB",
        *(duration(nanoseconds / 1e9) for nanoseconds in ranks), str(compared),
    )  # fmt: skip
    return row, same and drift < 2**20


def busy(core: int) -> subprocess.Popen[bytes]:
    """A process that does nothing else than keep a core busy."""
    return subprocess.Popen(["taskset", "-c", str(core), sys.executable, "-c", BUSY])


def soak(kinds: Sequence[str], pushes: int, load: bool) -> Iterator[tuple[tuple[str, ...], bool]]:
    """A row for each kind, and whether it held."""
    cores = sorted(os.sched_getaffinity(0))
    if load and len(cores) < 2:
        raise SystemExit("--load: expected two cores or more, got one")
    with ExitStack() as running:
        for core in cores[1:] if load else ():
            running.callback(running.enter_context(busy(core)).kill)
        for kind in kinds:
            if kind == "Python":
                yield in_python(pushes)
            else:
                yield in_rust(kind, pushes, {cores[0]} if load and kind != "two threads" else None)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=", ".join(KINDS))
    parser.add_argument("--pushes", type=int, default=10_000_000)
    parser.add_argument("--load", action="store_true")
    parser.add_argument("--page", type=Path)
    given = parser.parse_args()
    if given.pushes < 1 or (unknown := set(given.kinds) - set(KINDS)):
        parser.error("--pushes: expected at least 1" if given.pushes < 1 else f"KIND: {unknown}")
    kinds = given.kinds or (UNDER_LOAD if given.load else KINDS)
    rows, held = [], True
    for row, holds in soak(kinds, given.pushes, given.load):
        print(f"| {' | '.join(row)} |", "" if holds else "FAILED", flush=True)
        rows.append((row[0], f"{int(row[1]):,}", *row[2:-1], f"{int(row[-1]):,}"))
        held &= holds
    if given.page:
        made_by = "make soak LOAD=1" if given.load else "make soak"
        marks = [f"<!-- {which}: made by {made_by} -->" for which in ("begin", "end")]
        text = given.page.read_text(encoding="utf-8")
        given.page.write_text(replaced(text, table(HEADER, rows), *marks), encoding="utf-8")
    sys.exit(not held)


if __name__ == "__main__":
    main()
