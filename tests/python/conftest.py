"""A cache of their own for all tests, and pages for tests that are not about their pictures."""

import io
import os
import signal
from collections.abc import Iterator

import pytest


@pytest.fixture(scope="session", autouse=True)
def _cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The files of networks that the tests use are not noted in the user's own folder."""
    before = os.environ.get("SUREFIX_CACHE")
    os.environ["SUREFIX_CACHE"] = str(tmp_path_factory.mktemp("cache"))
    yield
    if before is None:
        del os.environ["SUREFIX_CACHE"]
    else:
        os.environ["SUREFIX_CACHE"] = before


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each figure of a page is one grey dot: nothing is drawn."""
    page = pytest.importorskip("surefix.report.page", exc_type=ModuleNotFoundError)
    file = io.BytesIO()
    page.Image.new("RGB", (1, 1), "grey").save(file, "PNG")
    monkeypatch.setattr(page, "png", lambda draw, size, theme: file.getvalue())


@pytest.fixture
def light_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each figure of a page is drawn once, on light paper."""
    page = pytest.importorskip("surefix.report.page", exc_type=ModuleNotFoundError)
    monkeypatch.setattr(page.Picture, "dark", property(lambda picture: picture.light))


@pytest.fixture(scope="session")
def ray_cluster() -> Iterator[str]:
    """A small cluster of Ray on this machine, for all tests of a process; its address. Commands in
    this process are in it, others join it by RAY_ADDRESS.
    """
    ray = pytest.importorskip("ray", exc_type=ModuleNotFoundError)
    if ray.is_initialized():
        # By other tests of this process.
        yield ray.get_runtime_context().gcs_address
        return
    before = signal.getsignal(signal.SIGTERM)
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    small = {"num_cpus": 2, "object_store_memory": 80 << 20, "include_dashboard": False}
    quiet = {"log_to_driver": False, "configure_logging": False, "logging_level": "ERROR"}
    ray.init("local", **small, **quiet)
    signal.signal(signal.SIGTERM, before)
    yield ray.get_runtime_context().gcs_address
    ray.shutdown()
