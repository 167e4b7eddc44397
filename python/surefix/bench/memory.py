"""The memory: how fast it can be read, and how much of it is free."""

from pathlib import Path

import numpy as np

from surefix._core import bench_read

__all__ = ["Bandwidth", "shortage"]

# More than that is read no slower, and would only take longer.
LARGEST = 1 << 30
# What is left to everybody else.
SPARE = 1 << 30


class Bandwidth:
    """Bytes a second that plain code reads, by how many bytes there are: caches are faster than
    memory.
    """

    def __init__(self, quick: bool) -> None:
        self.largest = LARGEST // 8 if quick else LARGEST
        self.seconds = 0.02 if quick else 0.4
        self.known: dict[tuple[int, int], float] = {}

    def __call__(self, size: int, threads: int = 1) -> float:
        """The bandwidth at ``size`` bytes, measured once for each size of one or two leading
        bits.
        """
        size = max(4096, min(size, self.largest))
        step = 1 << max(0, size.bit_length() - 2)
        key = (size // step * step, threads)
        if key not in self.known:
            # NumPy asks the system for huge pages where they pay.
            words = np.ones(key[0] // 8, np.uint64)
            self.known[key] = bench_read(words, self.seconds, threads)
        return self.known[key]


def shortage(needed: int) -> str:
    """Why there is not enough memory for so many bytes; nothing where there is, or where the system
    does not tell.
    """
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        free = next(
            int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable:")
        )
    except (OSError, StopIteration, ValueError):
        return ""
    if needed + SPARE <= free:
        return ""
    return f"it needs {needed / 1e9:.1f} GB of memory, and {free / 1e9:.1f} GB are free"
