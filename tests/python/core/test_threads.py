"""Several threads scan one map: from Python, and across a fork."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import surefix

RANDOM = np.random.default_rng(1)
ROWS = RANDOM.standard_normal((500, 64)).astype(np.float32)
QUERIES = RANDOM.standard_normal((20, 64)).astype(np.float32)


def fixes(localizer: surefix.Localizer) -> list[tuple[surefix.Fix, bytes]]:
    return [(localizer.push(query), localizer.distances.tobytes()) for query in QUERIES]


@pytest.mark.parametrize("threads", [1, 2, 3, 8])
def test_any_number_of_threads_gives_the_same_bits(threads: int) -> None:
    route = surefix.Map.from_descriptors(ROWS, metric="euclidean")
    localizer = surefix.Localizer(route, threads=threads, sequence_length=3)
    assert localizer.threads == threads
    assert fixes(localizer) == fixes(surefix.Localizer(route, sequence_length=3))


def test_a_small_map_needs_no_more_than_the_caller() -> None:
    assert surefix.Localizer(surefix.Map.from_descriptors(ROWS)).threads == 1


def test_a_restored_localizer_can_have_other_threads() -> None:
    route = surefix.Map.from_descriptors(ROWS, metric="cosine")
    one, three = surefix.Localizer(route), surefix.Localizer(route, threads=3)
    fixes(one)
    fixes(three)
    assert one.snapshot() == three.snapshot()
    two = surefix.Localizer.restore(route, one.snapshot(), threads=2)
    assert two.threads == 2
    assert fixes(two) == fixes(one)


@pytest.mark.parametrize("threads", [0, -1, 1.5, "two", 100_000])
def test_numbers_of_threads_that_cannot_be_are_refused(threads: Any) -> None:
    route = surefix.Map.from_descriptors(ROWS)
    with pytest.raises(surefix.SurefixValueError, match="threads"):
        surefix.Localizer(route, threads=threads)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_child_goes_on_alone() -> None:
    route = surefix.Map.from_descriptors(ROWS, metric="euclidean")
    localizer = surefix.Localizer(route, threads=3)
    expected = fixes(surefix.Localizer(route))
    assert fixes(localizer) == expected
    localizer.reset()
    child = os.fork()
    if child == 0:
        # Nothing of pytest may run here, whatever happens.
        status = 1
        try:
            same = fixes(localizer) == expected
            del localizer
            own = surefix.Localizer(route, threads=2)
            status = 0 if same and fixes(own) == expected else 2
        finally:
            os._exit(status)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert fixes(localizer) == expected


MANY = np.tile(ROWS, (30, 8))
# What is computed once, and asked for on a fresh map.
FIRST_LOOKS: dict[str, Callable[[surefix.Map], Callable[[], bytes]]] = {
    "fingerprint": lambda route: surefix.Localizer(route, threads=1).snapshot,
    "blank": lambda route: lambda: route.blank.tobytes(),
    "in one piece": lambda route: lambda: route.descriptors.tobytes()[-64:],
    "distances": lambda route: (lambda run: lambda: run.distances.tobytes()[-64:])(
        surefix.match_distances([MANY.T[:60], MANY.T[:60]])
    ),
}


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
@pytest.mark.parametrize("what", FIRST_LOOKS)
def test_a_child_forked_amid_a_first_look_goes_on_alone(what: str) -> None:
    """The thread that computes it does not come along, and the child does not wait for it."""
    first = surefix.Map.from_descriptors(MANY, metric="euclidean")
    expected = FIRST_LOOKS[what](first.extended(first.slice(0, 2)))()
    for attempt in range(6):
        look = FIRST_LOOKS[what](first.extended(first.slice(0, 2)))
        begun = threading.Event()

        def looks(look: Callable[[], bytes] = look, begun: threading.Event = begun) -> None:
            begun.set()
            look()

        thread = threading.Thread(target=looks)
        thread.start()
        begun.wait()
        time.sleep(0.001 * attempt)
        child = os.fork()
        if child == 0:
            status = 1
            try:
                # A child that waits for ever is ended by the signal.
                signal.signal(signal.SIGALRM, signal.SIG_DFL)
                signal.alarm(60)
                status = 0 if look() == expected else 2
            finally:
                os._exit(status)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
        thread.join()
