"""Runs the rows of the table, each in a child under limits of memory and time: hostile_runner.py
FOLDER [NAME ...] writes a line of JSON a row.
"""

from __future__ import annotations

import contextlib
import gc
import importlib.util
import io
import json
import os
import resource
import shutil
import signal
import sys
import traceback
import warnings
from pathlib import Path
from typing import Any

# Bytes that a row may take beyond what the process has, and seconds of processor.
MEMORY, SECONDS = 256 << 20, 10
# After that many seconds a row hangs, as on a pipe: it is ended.
HANGS = 60


def answer(row: Any, folder: Path) -> dict[str, Any]:
    """What the door says to the input."""
    path = row.make(folder)
    before = used()
    limits(before + MEMORY)
    said = io.StringIO()
    found: dict[str, Any] = {"classes": [], "text": ""}
    try:
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
            row.door(path)
    except BaseException as error:  # Whatever it is, the table judges it.
        text = said.getvalue() if isinstance(error, SystemExit) else str(error)
        found = {
            "classes": [each.__name__ for each in type(error).__mro__],
            "code": getattr(error, "code", None),
            "text": text[:4000],
            "length": len(text),
            "where": traceback.format_exc()[-1500:],
        }
    return found


def used() -> int:
    """The bytes of memory that count against the limit."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("VmData:"))


def limits(memory: int) -> None:
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    spent = sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
    resource.setrlimit(resource.RLIMIT_CPU, (int(spent) + SECONDS, int(spent) + SECONDS))
    signal.alarm(HANGS)


def in_child(row: Any, folder: Path) -> dict[str, Any]:
    """The answer of a child, or the signal that ended it."""
    reads, writes = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reads)
        # The words of a library on the way.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        try:
            content = json.dumps(answer(row, folder))
        except BaseException:
            content = json.dumps({"classes": ["none"], "text": traceback.format_exc()})
        with os.fdopen(writes, "w") as out:
            out.write(content)
        os._exit(0)
    os.close(writes)
    with os.fdopen(reads) as out:
        content = out.read()
    _, status, spent = os.wait4(child, 0)
    seconds = round(spent.ru_utime + spent.ru_stime, 3)
    if not content:
        how = f"signal {os.WTERMSIG(status)}" if os.WIFSIGNALED(status) else "ended"
        return {"classes": [how], "text": "", "seconds": seconds}
    return {**json.loads(content), "seconds": seconds}


def main(place: str, *names: str) -> None:
    """Runs those rows, or all."""
    warnings.simplefilter("error")
    from hostile_table import ROWS

    # Children share what they do not write, and their collector would write all.
    gc.disable()
    gc.freeze()

    for index, row in enumerate(ROWS):
        if names and row.name not in names:
            continue
        missing = [name for name in row.needs if importlib.util.find_spec(name) is None]
        folder = Path(place, str(index))
        folder.mkdir()
        found = {"missing": missing} if missing else in_child(row, folder)
        print(json.dumps({"name": row.name, **found}), flush=True)
        shutil.rmtree(folder)


if __name__ == "__main__":
    main(*sys.argv[1:])
