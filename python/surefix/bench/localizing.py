"""A localizer of so many threads on a map, and what it says of a few descriptors."""

from collections.abc import Callable, Sequence
from typing import Any

from surefix import Localizer, Map
from surefix.bench.step import Answer, summary

__all__ = ["answers", "localizer"]


def localizer(known: Map, threads: int | None, **options: Any) -> Localizer:
    """A fresh one."""
    return Localizer(known, threads=threads, **options)


def answers(fresh: Callable[[], Localizer], queries: Sequence[Any]) -> Callable[[], list[Answer]]:
    """What a fresh localizer says of each query."""

    def answer() -> list[Answer]:
        localizer = fresh()
        return [summary(localizer.push(query)) for query in queries]

    return answer
