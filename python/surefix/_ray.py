"""Work as a list of jobs: one after the other here, or as tasks of Ray. The one place that joins a
cluster.

``mapped(function, of, jobs)`` is ``function(of, job)`` for each job, in order. Inside ``tasks()``
Ray runs them: ``of``, which may be large, lies in its store once, and a few tasks are in flight. A
task works in the folder of the command, so that names of files mean the same there, and what it
says is said here.
"""

import logging
import os
import signal
import socket
import sys
import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import (
    closing,
    contextmanager,
    suppress,
)
from typing import Any, TypeVar

from surefix import _ray_task
from surefix._core import __version__
from surefix._extra import require
from surefix.errors import SurefixError, mismatch

__all__ = ["Cluster", "completed", "hold", "is_spread", "mapped", "tasks"]

T = TypeVar("T")
J = TypeVar("J")
R = TypeVar("R")

# In seconds: how long a machine may take to answer.
TIMEOUT = 5.0
# Tasks in flight for each processor of the cluster: the next one waits where it will run.
AHEAD = 2
# How often Ray begins a task again whose worker died.
RETRIES = 3
LOG = logging.getLogger("surefix")


class Cluster:
    """A cluster of Ray: the one that ``RAY_ADDRESS`` names, else one that is started on this
    machine; or the one that this process is in already, which it does not leave. It is joined when
    it is first used.

    Raises
    ------
    SurefixError
        If Ray is not installed, or there is no cluster at the address.
    """

    def __init__(self, what: str = "--ray") -> None:
        self._ray = require("ray", what, "Ray", "surefix[ray]")
        self._address = os.environ.get("RAY_ADDRESS") or "local"
        self._own = False
        self._references: dict[int, tuple[Any, Any]] = {}
        if not self._ray.is_initialized():
            _check_there(self._address)

    def __enter__(self) -> "Cluster":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Leaves the cluster, which ends the tasks that run; ends one that was started here."""
        self._references.clear()
        if self._own:
            self._own = False
            self._ray.shutdown()

    @property
    def ray(self) -> Any:
        """The module, in the cluster."""
        if not self._ray.is_initialized():
            self._own = True
            _join(self._ray, self._address)
        return self._ray

    @property
    def processors(self) -> int:
        """How many tasks can run at the same time."""
        return max(1, int(self.ray.cluster_resources().get("CPU", 1)))

    def hold(self, value: T) -> T:
        """The same value in Ray's store: its arrays are read-only, in memory that all processes of
        a machine share, until the cluster is left.
        """
        reference = self.ray.put(value)
        kept: T = self.ray.get(reference)
        self._references[id(kept)] = kept, reference
        return kept

    def reference(self, value: Any) -> Any:
        """Of a value in the store, or one that is put there."""
        kept, reference = self._references.get(id(value), (None, None))
        return self.ray.put(value) if reference is None or kept is not value else reference


_cluster: Cluster | None = None


@contextmanager
def tasks(wanted: bool = True) -> Iterator[None]:
    """Meanwhile ``mapped`` has its jobs done by Ray, if that is wanted. Results may lie in its
    store: they are used inside.
    """
    global _cluster
    if not wanted:
        yield
        return
    with Cluster() as joined:
        _cluster = joined
        try:
            yield
        finally:
            _cluster = None


def is_spread() -> bool:
    """Whether Ray does the jobs."""
    return _cluster is not None


def hold(value: T) -> T:
    """A value that several calls of ``mapped`` are given, in Ray's store if that does the work."""
    return value if _cluster is None else _cluster.hold(value)


def mapped(function: Callable[[T, J], R], of: T, jobs: Iterable[J], gpus: int = 0) -> Iterator[R]:
    """``function(of, job)`` for each job, in the order of the jobs, which are taken as they are
    needed; each task is given ``gpus`` graphics cards.

    Raises
    ------
    SurefixError
        If a worker has another version of surefix, or dies again and again. What the function
        raises is raised here, when it is the turn of its job.
    """
    if _cluster is None:
        # No job is held while the next one is made.
        for job in jobs:
            yield function(of, job)
            del job
        return
    early: dict[int, Any] = {}
    following = 0
    with closing(_done(_cluster, function, of, jobs, gpus)) as done:
        for index, reference in done:
            early[index] = reference
            while following in early:
                yield _result(_cluster.ray, early.pop(following))
                following += 1


def completed(function: Callable[[T, J], R], of: T, jobs: Iterable[J]) -> Iterator[tuple[int, R]]:
    """The index and the result of each job as soon as it is there."""
    if _cluster is None:
        yield from enumerate(mapped(function, of, jobs))
        return
    with closing(_done(_cluster, function, of, jobs, 0)) as done:
        for index, reference in done:
            yield index, _result(_cluster.ray, reference)


def _done(
    cluster: Cluster, function: Callable[[T, J], R], of: T, jobs: Iterable[J], gpus: int
) -> Generator[tuple[int, Any], None, None]:
    """The index of each job, and the reference of its result, as soon as it is there."""
    ray, held = cluster.ray, [cluster.reference(of)]
    task = ray.remote(_ray_task.run).options(max_retries=RETRIES, num_gpus=gpus)
    limit = AHEAD * cluster.processors
    flying: dict[Any, int] = {}
    left = enumerate(jobs)
    try:
        while True:
            while len(flying) < limit and (following := next(left, None)) is not None:
                index, job = following
                work = ray.cloudpickle.dumps((function, job))
                flying[task.remote(__version__, os.getcwd(), held, work)] = index
            if not flying:
                return
            (done,), _ = ray.wait([*flying], num_returns=1)
            yield flying.pop(done), done
            del done
    finally:
        # After an error, or if the caller has seen enough.
        for each in flying:
            ray.cancel(each)


def _result(ray: Any, reference: Any) -> Any:
    """That of a task; raises what it raised."""
    try:
        result, failed, said = ray.get(reference)
    except ray.exceptions.OutOfMemoryError:
        short = "the system ended a task, as its machine had no memory left; start Ray with fewer"
        raise SurefixError(f"Ray: {short} processors there (ray start --num-cpus)") from None
    except ray.exceptions.RayTaskError as error:
        # The task could not begin, or its result could not be sent.
        problem = _line(error.cause or error)
        if "failed to import" in problem:
            got = "a worker that has another one or none"
            raise mismatch("Ray", f"surefix {__version__} on all machines", got) from None
        raise SurefixError(f"Ray: a task failed: {problem}") from None
    except ray.exceptions.RayError as error:
        begun = f"a worker died {RETRIES + 1} times at one task"
        died = isinstance(error, ray.exceptions.WorkerCrashedError)
        raise SurefixError(f"Ray: {begun if died else _line(error)}") from None
    for level, text in said.logged:
        LOG.log(level, text)
    sys.stdout.write(said.out)
    sys.stderr.write(said.err)
    if failed is not None:
        raise failed
    return result


def _join(ray: Any, address: str) -> None:
    # A tool reports nothing to the makers of its libraries unasked.
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    own: dict[str, Any] = {"include_dashboard": False} if address == "local" else {}
    logging.getLogger("ray").setLevel(logging.ERROR)
    with suppress(AttributeError):
        # It would write of its workers to the standard output, amid ours.
        ray._private.worker.print_worker_logs = lambda *given: None
    before = signal.getsignal(signal.SIGTERM)
    try:
        ray.init(address, log_to_driver=False, configure_logging=False, **own)
    except (OSError, RuntimeError, ValueError) as error:
        raise SurefixError(f"Ray, {address}: cannot join the cluster: {_line(error)}") from None
    finally:
        # Ray takes it, but not that of Ctrl-C.
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTERM, before)


def _check_there(address: str) -> None:
    """Ray itself would wait for minutes, and then end the process."""
    if address in ("auto", "local"):
        return
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if not (host and colon and port.isdecimal() and int(port) < 1 << 16):
        raise mismatch("RAY_ADDRESS", "HOST:PORT, auto or local", repr(address))
    try:
        socket.create_connection((host.strip("[]"), int(port)), TIMEOUT).close()
    except OSError as error:
        problem = f"there is no cluster: {error.strerror or error}"
        raise SurefixError(f"RAY_ADDRESS {address}: {problem}") from None


def _line(error: BaseException) -> str:
    """What an error says, in a line."""
    said = " ".join(str(error).split()) or type(error).__name__
    return said if len(said) <= 300 else f"{said[:300]}..."
