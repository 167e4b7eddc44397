"""One local cluster for all tests of a worker of pytest."""

import warnings
from collections.abc import Iterator
from typing import Any

import pytest


@pytest.fixture(scope="session")
def ray() -> Iterator[Any]:
    pytest.importorskip("ray")
    from surefix._ray import Cluster

    with warnings.catch_warnings():
        # Of Ray's own code.
        warnings.simplefilter("ignore")
        cluster = Cluster()
    yield cluster.ray
    cluster.close()
