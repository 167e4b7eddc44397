"""Checks that wheels keep the promises of their names: ``python packaging/audit.py dist/*.whl``.

A Linux wheel's symbols must not need a newer Linux than its name promises (checked by auditwheel).
A wheel must hold the package with its types and licences, and nothing else.
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
# The dependencies of a plain `pip install surefix`.
DEPENDENCIES = {"numpy", "rich", "typer"}


def main() -> int:
    """Audits. Exit codes: 0, 1 (a problem)."""
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
    """The files that are missing from it, and those that do not belong in it."""
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
    """The oldest Linux that its symbols run on, in words, and a problem if its name promises an
    older one.
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
    """The glibc of ``manylinux_2_17_x86_64``, as numbers; for a tag without one, the largest."""
    parts = tag.split("_")
    return (int(parts[1]), int(parts[2])) if parts[0] == "manylinux" else (sys.maxsize, 0)


if __name__ == "__main__":
    sys.exit(main())
