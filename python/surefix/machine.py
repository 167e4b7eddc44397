"""The machine that a report was made on: timings mean nothing without it."""

import os
import platform
from pathlib import Path


def machine() -> str:
    """The processor, its cores, the system and the Python, in a few words."""
    system = f"{platform.system()}, Python {platform.python_version()}"
    return f"{_processor()}, {os.cpu_count()} cores, {system}"


def _processor() -> str:
    """The processor's name, if the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    names += [platform.processor(), platform.machine(), "an unnamed processor"]
    return next(filter(None, names))
