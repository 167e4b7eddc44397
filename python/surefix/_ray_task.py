"""A job as a task of Ray: what runs in a worker. ``_ray`` sends it there."""

import io
import logging
import os
from collections.abc import Sequence
from contextlib import ExitStack, chdir, redirect_stderr, redirect_stdout
from typing import Any, NamedTuple

from surefix._core import __version__
from surefix.errors import mismatch

__all__ = ["Said", "run"]

LOG = logging.getLogger("surefix")
# The last value that tasks in this worker were given, by its name in Ray's store.
_held: dict[str, Any] = {}


class Said(NamedTuple):
    """What a task wrote to its streams, and what it logged."""

    out: str = ""
    err: str = ""
    logged: Sequence[tuple[int, str]] = ()


class _Log(logging.Handler):
    """Keeps what is logged in a task."""

    def __init__(self) -> None:
        super().__init__()
        self.logged: list[tuple[int, str]] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.logged.append((record.levelno, record.getMessage()))


def run(version: str, folder: str, held: list[Any], work: bytes) -> tuple[Any, Any, Said]:
    """Runs in a worker: the result, what was raised, and what was said."""
    import ray

    # Before anything of the package is read that another version may not have.
    node = ray.util.get_node_ip_address()  # type: ignore[no-untyped-call, unused-ignore]
    if version != __version__:
        return None, mismatch(f"Ray, machine {node}", f"surefix {version}", __version__), Said()
    # A task has as many threads as Ray gives it processors.
    os.environ.setdefault("RAYON_NUM_THREADS", os.environ.get("OMP_NUM_THREADS", "1"))
    out, err, log = io.StringIO(), io.StringIO(), _Log()
    result: Any = None
    failed: Exception | None = None
    with ExitStack() as inside:
        try:
            inside.enter_context(chdir(folder))
        except OSError as error:
            expected = f"the folder {folder} on all machines"
            reason = error.strerror or error
            return None, mismatch(f"Ray, machine {node}", expected, reason), Said()
        inside.enter_context(redirect_stdout(out))
        inside.enter_context(redirect_stderr(err))
        LOG.addHandler(log)
        inside.callback(LOG.removeHandler, log)
        try:
            (reference,) = held
            name = reference.hex()
            if name not in _held:
                _held.clear()
                _held[name] = ray.get(reference)
            function, job = ray.cloudpickle.loads(work)
            result = function(_held[name], job)
        except Exception as error:
            failed = error
    return result, failed, Said(out.getvalue(), err.getvalue(), log.logged)
