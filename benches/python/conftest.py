"""Settings of the comparison with rivals: sizes, threads, and the facts that the page needs."""

import importlib
from collections.abc import Iterator
from importlib.metadata import packages_distributions, version
from typing import Any

import pytest

import surefix
from surefix._core import instruction_set
from surefix.cli.bench import memory_speed
from surefix.machine import machine
from work import Work, caches, shortage

RIVALS = {
    "numpy": "NumPy", "scipy": "SciPy", "PIL": "Pillow", "cv2": "OpenCV", "faiss": "faiss",
    "hmmlearn": "hmmlearn", "simsimd": "simsimd", "threadpoolctl": "threadpoolctl",
}  # fmt: skip
_skipped: list[str] = []
_speeds: dict[tuple[int, int], float] = {}


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--quick", action="store_true", help="small sizes: to see that it works")


def pytest_configure(config: pytest.Config) -> None:
    quick = config.getoption("--quick")
    config.option.benchmark_min_rounds = 3 if quick else 7
    config.option.benchmark_max_time = 0.02 if quick else 4.0
    config.option.benchmark_disable_gc = True
    config.option.benchmark_sort = "fullname"


@pytest.fixture(scope="session")
def quick(request: pytest.FixtureRequest) -> bool:
    return bool(request.config.getoption("--quick"))


@pytest.fixture(scope="session", autouse=True)
def one_thread() -> Iterator[None]:
    """One thread for each rival."""
    for module, limit in (("cv2", "setNumThreads"), ("faiss", "omp_set_num_threads")):
        if module in packages_distributions():
            getattr(importlib.import_module(module), limit)(1)
    pools = pytest.importorskip("threadpoolctl")
    with pools.threadpool_limits(1):
        yield


@pytest.fixture
def measure(benchmark: Any, quick: bool, request: pytest.FixtureRequest) -> Any:
    """Checks an entrant's answer, times it, and notes the facts for the page."""

    def run(work: Work, name: str) -> None:
        if name not in work.entrants:
            pytest.skip(f"{name} takes no part in {work.name}, or is not installed")
        work.check(name)
        benchmark.group = work.name
        entrant = work.entrants[name]
        key = (work.read, work.threads)
        if key not in _speeds:
            _speeds[key] = memory_speed(work.read, work.threads, 0.02 if quick else 0.4)
        benchmark.extra_info.update(
            section=request.node.function.__doc__, name=name,
            ours=name == next(iter(work.entrants)), target=entrant.target,
            scale=entrant.scale, read=work.read, memory=_speeds[key], quick=quick,
        )  # fmt: skip
        benchmark(entrant.call)

    return run


@pytest.fixture(scope="session")
def enough_memory() -> Any:
    """Skips a work for which the memory is too small, and the page says so."""

    def check(name: str, needed: int) -> None:
        if why := shortage(needed):
            if f"{name}: {why}" not in _skipped:
                _skipped.append(f"{name}: {why}")
            pytest.skip(why)

    return check


def pytest_benchmark_update_json(output_json: dict[str, Any]) -> None:
    distributions = packages_distributions()
    output_json["skipped"] = _skipped
    output_json["missing"] = [title for name, title in RIVALS.items() if name not in distributions]
    output_json["facts"] = {
        "machine": machine(),
        "caches of a core": caches(),
        "instruction set": f"{instruction_set()} (SUREFIX_ISA names another)",
        "surefix": f"{surefix.__version__}, 1 thread if a line does not say otherwise; "
        "so have its rivals",
        "rivals": ", ".join(
            f"{title} {version(distributions[name][0])}"
            for name, title in RIVALS.items()
            if name in distributions
        ),
    }
