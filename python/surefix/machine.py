"""The machine: its name, as timings mean nothing without it, and its memory."""

import os
import platform
import re
from pathlib import Path

from surefix.errors import SurefixError


def machine() -> str:
    """The processor, its cores, the system and the Python, in a few words."""
    system = f"{platform.system()}, Python {platform.python_version()}"
    return f"{processor()}, {os.cpu_count()} cores, {system}"


def room_for(size: int, what: str) -> None:
    """Refuses what needs more memory than there is, with whose limit it is and how to raise it.

    Raises
    ------
    SurefixError
        It names ``what`` needs ``size`` bytes, and the least limit: of this process
        (``ulimit -v``), of its container, or of the machine.
    """
    least = min(limits_left(), default=None)
    if least is not None and least[0] < size:
        free, whose = least
        raise SurefixError(f"{what}: needs {in_gb(size)}, but {in_gb(max(free, 0))} are {whose}")


def in_gb(size: int) -> str:
    """Bytes in words."""
    return f"{size / 1e9:.1f} GB" if size >= 1e8 else f"{size / 1e6:.1f} MB"


def limits_left() -> list[tuple[int, str]]:
    """The bytes that each limit leaves, as far as the system tells it, and whose it is."""
    found = []
    try:
        import resource

        for kind, name, option in (
            (resource.RLIMIT_AS, "VmSize:", "-v"),
            (resource.RLIMIT_DATA, "VmData:", "-d"),
        ):
            limit, _ = resource.getrlimit(kind)
            if limit != resource.RLIM_INFINITY:
                used = _kilobytes("/proc/self/status", name) or 0
                lifts = f"ulimit {option} unlimited lifts it if it may"
                raising = f"ulimit {option}, {limit // 1024} KB: {lifts}"
                found.append((limit - used, f"left by the limit of this shell ({raising})"))
    except ImportError:
        pass
    group = Path("/sys/fs/cgroup")
    try:
        limit = int((group / "memory.max").read_text(encoding="ascii"))
        used = int((group / "memory.current").read_text(encoding="ascii"))
        # Pages of files are given back when memory is short.
        files = re.search(r"^file (\d+)$", (group / "memory.stat").read_text("ascii"), re.MULTILINE)
        left = limit - max(used - int(files[1] if files else 0), 0)
        found.append((left, "left by the limit of this container (docker run --memory)"))
    except (OSError, ValueError):
        pass
    free = _kilobytes("/proc/meminfo", "MemAvailable:")
    if free is not None:
        found.append((free, "free on this machine"))
    return found


def _kilobytes(file: str, name: str) -> int | None:
    """A line of kilobytes of a file of the system's, in bytes."""
    try:
        lines = Path(file).read_text(encoding="utf-8").splitlines()
        return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(name))
    except (OSError, ValueError, StopIteration):
        return None


def processor() -> str:
    """The processor's name, if the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    names += [platform.processor(), platform.machine(), "an unnamed processor"]
    return next(filter(None, names))
