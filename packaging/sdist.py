"""Checks a source distribution: ``python packaging/sdist.py dist/surefix-*.tar.gz``."""

import argparse
import sys
import tarfile
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).resolve().parents[1]
NEEDED = (
    "Cargo.lock",
    "Cargo.toml",
    "LICENSE-APACHE",
    "LICENSE-MIT",
    "PKG-INFO",
    "README.md",
    "pyproject.toml",
)
# All that the wheel is built from.
SOURCES = (
    ("src", "*.rs"),
    ("simulate/src", "*.rs"),
    ("python/src", "*.rs"),
    ("python/surefix", "*.py"),
    ("python/surefix", "*.css"),
    ("python/surefix", "*.js"),
)
SUFFIXES = {".css", ".js", ".lock", ".md", ".py", ".pyi", ".rs", ".toml", ".typed"}
NAMES = {"LICENSE-APACHE", "LICENSE-MIT", "PKG-INFO"}


def main() -> int:
    """Checks. Exit codes: 0, 1 (a problem)."""
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("sdist", type=Path)
    file = options.parse_args().sdist
    with tarfile.open(file) as pack:
        names = {
            str(PurePosixPath(*PurePosixPath(member.name).parts[1:]))
            for member in pack
            if member.isfile()
        }
    needed = {
        source.relative_to(ROOT).as_posix()
        for folder, kind in SOURCES
        for source in (ROOT / folder).rglob(kind)
    }
    problems = [f"{name} is missing" for name in sorted({*needed, *NEEDED} - names)]
    problems += [
        f"{name} has no business in it"
        for name in sorted(names)
        if "__pycache__" in name
        or (name not in NAMES and PurePosixPath(name).suffix not in SUFFIXES)
    ]
    for problem in problems:
        print(f"check-sdist: {file.name}: {problem}", file=sys.stderr)
    size = file.stat().st_size
    print(f"check-sdist: {file.name}: {len(names)} files, {size:,} bytes, {len(problems)} problems")
    return int(bool(problems))


if __name__ == "__main__":
    sys.exit(main())
