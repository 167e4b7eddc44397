"""Several threads scan one map: from Python, and across a fork."""

from __future__ import annotations

import os
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
