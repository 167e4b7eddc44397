"""What was measured on and against: figures mean nothing without it."""

from collections.abc import Sequence
from pathlib import Path

from surefix import __version__
from surefix._core import instruction_set
from surefix.bench.line import Settings
from surefix.bench.rivals import Rivals
from surefix.machine import machine

__all__ = ["caches", "facts"]

CPU0 = Path("/sys/devices/system/cpu/cpu0/cache")


def facts(settings: Settings, rivals: Rivals) -> Sequence[tuple[str, str]]:
    """Names and values, in the order of a reader's questions."""
    threads = "1 thread" if settings.threads == 1 else f"{settings.threads} threads"
    found = [
        ("machine", machine()),
        ("caches of a core", caches()),
        ("instruction set", f"{instruction_set()} (SUREFIX_ISA names another)"),
        (
            "surefix",
            f"{__version__}, {threads} where a line does not say otherwise; so have its rivals",
        ),
        ("rivals", ", ".join(f"{name} {version}" for name, version in rivals.versions.items())),
    ]
    if settings.quick:
        found.append(("quick", "small sizes and few rounds: to see that it works, not to quote"))
    return found


def caches(folder: Path = CPU0) -> str:
    """The sizes of the first core's caches, where the system tells them."""
    found = []
    for index in sorted(folder.glob("index*")):
        try:
            level, kind, size = (
                (index / name).read_text(encoding="ascii").strip()
                for name in ("level", "type", "size")
            )
        except (OSError, UnicodeDecodeError, ValueError):
            continue
        if kind != "Instruction":
            found.append(f"L{level} {size}")
    return ", ".join(found) or "not told by the system"
