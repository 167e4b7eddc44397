"""Jobs done by Ray are those done here: results, order, errors, what is said; and one line if a
cluster fails.
"""

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from surefix import SurefixError, SurefixFileError, SurefixValueError, _ray

pytest.importorskip("ray", exc_type=ModuleNotFoundError)
pytestmark = pytest.mark.slow

ROWS = np.arange(60, dtype=np.float32).reshape(6, 10)


@pytest.fixture
def joined(ray_cluster: str) -> Iterator[None]:
    # Workers have not this file.
    cloudpickle = pytest.importorskip("ray").cloudpickle
    cloudpickle.register_pickle_by_value(sys.modules[__name__])
    with _ray.tasks():
        yield
    cloudpickle.unregister_pickle_by_value(sys.modules[__name__])


def total(rows: Any, job: int) -> tuple[float, bool]:
    print(f"row {job}")
    print(f"row {job} of {len(rows)}", file=sys.stderr)
    return float(rows[job].sum()), rows.flags.writeable


def test_results_come_in_order_with_what_was_said(
    joined: None, capsys: pytest.CaptureFixture[str]
) -> None:
    held = _ray.hold(ROWS)
    found = list(_ray.mapped(total, held, range(6)))
    out, err = capsys.readouterr()
    assert found == [(float(row.sum()), False) for row in ROWS]
    assert out.splitlines() == [f"row {job}" for job in range(6)]
    assert err.splitlines() == [f"row {job} of 6" for job in range(6)]
    assert sorted(_ray.completed(total, held, range(6))) == list(enumerate(found))


def test_jobs_are_taken_as_they_are_needed(joined: None) -> None:
    taken = []

    def jobs() -> Iterator[int]:
        for job in range(1000):
            taken.append(job)
            yield job

    results = _ray.mapped(lambda of, job: of + job, 1, jobs())
    assert [next(results) for _ in range(5)] == [1, 2, 3, 4, 5]
    results.close()
    # Two in flight for each of two processors, beside those that are done.
    assert len(taken) < 100


def refuse(kind: Any, job: int) -> int:
    if job >= 2:
        raise kind(f"job {job} is bad")
    return job


@pytest.mark.parametrize(
    "kind", [SurefixError, SurefixValueError, SurefixFileError, ZeroDivisionError]
)
def test_the_first_error_of_the_jobs_is_raised_as_it_was(joined: None, kind: Any) -> None:
    results = _ray.mapped(refuse, kind, range(6))
    assert [next(results), next(results)] == [0, 1]
    with pytest.raises(kind, match="job 2 is bad") as raised:
        next(results)
    assert type(raised.value) is kind


def die(marker: Path, job: int) -> int:
    if job == 1 and len(list(marker.iterdir())) < 2:
        (marker / str(os.getpid())).touch()
        os._exit(1)
    return job


def test_a_task_whose_worker_dies_is_begun_again(joined: None, tmp_path: Path) -> None:
    assert list(_ray.mapped(die, tmp_path, range(3))) == [0, 1, 2]
    assert len(list(tmp_path.iterdir())) == 2


def test_a_worker_that_dies_each_time_is_one_line(
    joined: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_ray, "RETRIES", 1)
    with pytest.raises(SurefixError) as refused:
        list(_ray.mapped(lambda of, job: os._exit(1), None, [0]))
    assert str(refused.value) == "Ray: a worker died 2 times at one task"


def test_another_version_on_a_worker_is_refused(
    joined: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    theirs = _ray.__version__
    monkeypatch.setattr(_ray, "__version__", "99.1")
    with pytest.raises(SurefixValueError) as refused:
        list(_ray.mapped(total, ROWS, [0]))
    first, _, rest = str(refused.value).partition(": ")
    assert first.startswith("Ray, machine ")
    assert rest == f"expected surefix 99.1, got {theirs}"


def test_a_worker_without_surefix_is_refused(joined: None, monkeypatch: pytest.MonkeyPatch) -> None:
    # The module of the task is not there to be imported.
    gone = ModuleType("surefix_of_here_alone")
    exec("def run(*given): pass", vars(gone))
    monkeypatch.setitem(sys.modules, gone.__name__, gone)
    monkeypatch.setattr(_ray, "_ray_task", gone)
    with pytest.raises(SurefixValueError) as refused:
        list(_ray.mapped(total, ROWS, [0]))
    ours = f"expected surefix {_ray.__version__} on all machines"
    assert str(refused.value) == f"Ray: {ours}, got a worker that has another one or none"


def test_a_folder_that_a_machine_lacks_is_refused(
    joined: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_ray.os, "getcwd", lambda: "/no/such/folder")
    with pytest.raises(SurefixValueError, match="expected the folder /no/such/folder on all"):
        list(_ray.mapped(total, ROWS, [0]))


def test_a_job_that_has_jobs_does_them_itself(joined: None) -> None:
    def more(of: int, job: int) -> list[int]:
        return list(_ray.mapped(lambda _, each: of * each, None, range(job)))

    assert list(_ray.mapped(more, 2, [1, 3])) == [[0], [0, 2, 4]]


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("127.0.0.1:1", "RAY_ADDRESS 127.0.0.1:1: there is no cluster: Connection refused"),
        ("somewhere", "RAY_ADDRESS: expected HOST:PORT, auto or local, got 'somewhere'"),
        ("here:99999", "RAY_ADDRESS: expected HOST:PORT, auto or local, got 'here:99999'"),
    ],
)
def test_a_cluster_that_is_not_there_is_one_line(
    address: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    ray = pytest.importorskip("ray")
    monkeypatch.setattr(ray, "is_initialized", lambda: False)
    monkeypatch.setenv("RAY_ADDRESS", address)
    with pytest.raises(SurefixError) as refused, _ray.tasks():
        pass
    assert str(refused.value) == said


def test_without_ray_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(SurefixError) as refused, _ray.tasks():
        pass
    said = '--ray takes Ray, which is not installed: pip install "surefix[ray]"'
    assert str(refused.value) == said
