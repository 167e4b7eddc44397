"""Whether wheels are what they say they are: ``python packaging/audit.py dist/*.whl``.

A wheel's own symbols must not ask for a newer Linux than its name promises (by auditwheel, on
Linux's wheels), and it holds the package with its types and licences, and nothing else.
"""

import argparse
import fnmatch
import json
import subprocess
import sys
import zipfile
from email import message_from_bytes
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "python" / "surefix"
NEEDED = (
    "surefix/_core.pyi",
    "surefix/py.typed",
    "surefix-*.dist-info/METADATA",
    "surefix-*.dist-info/entry_points.txt",
    "surefix-*.dist-info/licenses/LICENSE-APACHE",
    "surefix-*.dist-info/licenses/LICENSE-MIT",
)
ALLOWED = (*NEEDED, "surefix/*.py", "surefix/*.css", "surefix/_core.*", "surefix-*.dist-info/*")
# What a plain `pip install surefix` brings.
DEPENDENCIES = {"numpy", "rich", "typer"}


def main() -> int:
    """Audit. Exit codes: 0, 1 (something is amiss)."""
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("wheels", type=Path, nargs="+")
    amiss = 0
    for wheel in options.parse_args().wheels:
        problems = contents(wheel)
        said = "no glibc in it"
        if "linux" in wheel.name:
            said, more = glibc(wheel)
            problems += more
        for problem in problems:
            print(f"check-wheel: {wheel.name}: {problem}", file=sys.stderr)
        print(
            f"check-wheel: {wheel.name}: {said}, {wheel.stat().st_size:,} bytes, {len(problems)} problems"
        )
        amiss += len(problems)
    return int(bool(amiss))


def contents(wheel: Path) -> list[str]:
    """What is missing from it, and what has no business in it."""
    with zipfile.ZipFile(wheel) as pack:
        names = pack.namelist()
        about = message_from_bytes(
            pack.read(next(name for name in names if name.endswith(".dist-info/METADATA")))
        )
    sources = [f"surefix/{file.relative_to(PACKAGE).as_posix()}" for file in PACKAGE.rglob("*.py")]
    problems = [
        f"{needed} is missing"
        for needed in (*NEEDED, *sources)
        if not fnmatch.filter(names, needed)
    ]
    problems += [
        f"{name} has no business in it"
        for name in names
        if "__pycache__" in name or not any(fnmatch.fnmatch(name, allowed) for allowed in ALLOWED)
    ]
    needs = [line for line in about.get_all("Requires-Dist", []) if "extra ==" not in line]
    packages = {line.partition(">")[0].strip() for line in needs}
    if packages != DEPENDENCIES:
        problems.append(f"expected to need {sorted(DEPENDENCIES)}, needs {sorted(packages)}")
    return problems


def glibc(wheel: Path) -> tuple[str, list[str]]:
    """The oldest Linux that its symbols are for, in words, and whether its name promises an older
    one.
    """
    command = [sys.executable, "-m", "auditwheel", "show", "--json", str(wheel)]
    found = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    real = found["overall_tag"]
    promised = [
        tag for tag in wheel.stem.rpartition("-")[2].split(".") if tag.startswith("manylinux_")
    ]
    kept = promised and version(real) <= min(map(version, promised))
    return f"symbols of {real}", [] if kept else [
        f"its symbols are those of {real}, its name promises {promised}"
    ]


def version(tag: str) -> tuple[int, int]:
    """The glibc of ``manylinux_2_17_x86_64``, as numbers; a tag without one is for no other
    Linux.
    """
    parts = tag.split("_")
    return (int(parts[1]), int(parts[2])) if parts[0] == "manylinux" else (sys.maxsize, 0)


if __name__ == "__main__":
    sys.exit(main())
