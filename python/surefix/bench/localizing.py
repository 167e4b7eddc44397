"""A localizer of so many threads on a map, and what it says of a few descriptors."""

from collections.abc import Callable, Sequence
from typing import Any

from surefix import Localizer, Map, SurefixValueError
from surefix.bench.step import Answer, summary

__all__ = ["answers", "has_threads", "localizer"]


def has_threads(known: Map) -> bool:
    """Whether this build's localizer takes a number of threads."""
    options: dict[str, Any] = {"threads": 1}
    try:
        Localizer(known, **options)
    except SurefixValueError:
        return False
    return True


def localizer(known: Map, threads: int | None, **options: Any) -> Localizer:
    """A fresh one."""
    chosen: dict[str, Any] = {"threads": threads} if has_threads(known) else {}
    return Localizer(known, **chosen, **options)


def answers(fresh: Callable[[], Localizer], queries: Sequence[Any]) -> Callable[[], list[Answer]]:
    """What a fresh localizer says of each query."""

    def answer() -> list[Answer]:
        localizer = fresh()
        return [summary(localizer.push(query)) for query in queries]

    return answer
