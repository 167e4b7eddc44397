"""Checks the files of the crate: ``python packaging/crate.py``, after ``cargo package``."""

import subprocess
import sys
import tarfile
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).resolve().parents[1]
# A build from the archive needs these.
NEEDED = (
    "Cargo.toml",
    "Cargo.lock",
    "README.md",
    "CHANGELOG.md",
    "LICENSE-MIT",
    "LICENSE-APACHE",
    "src/lib.rs",
)
SUFFIXES = {".lock", ".md", ".orig", ".rs", ".toml"}
NAMES = {".cargo_vcs_info.json", "LICENSE-MIT", "LICENSE-APACHE"}
# The limit of crates.io is ten times as large.
LARGEST = 1_000_000


def main() -> int:
    """Checks. Exit codes: 0, 1 (a problem)."""
    command = ["cargo", "pkgid", "--package", "surefix"]
    pack = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    version = pack.stdout.strip().rpartition("#")[2].rpartition("@")[2]
    file = ROOT / "target" / "package" / f"surefix-{version}.crate"
    with tarfile.open(file) as crate:
        names = [str(PurePosixPath(*PurePosixPath(name).parts[1:])) for name in crate.getnames()]
    problems = [f"{needed} is missing" for needed in NEEDED if needed not in names]
    problems += [
        f"{name} has no business in it"
        for name in names
        if name.startswith(("benches/instructions/", "capi/", "fuzz/", "python/", "simulate/"))
        or (name not in NAMES and PurePosixPath(name).suffix not in SUFFIXES)
    ]
    size = file.stat().st_size
    if size > LARGEST:
        problems.append(f"it has {size:,} bytes, more than {LARGEST:,}")
    for problem in problems:
        print(f"check-crate: {file.name}: {problem}", file=sys.stderr)
    print(f"check-crate: {file.name}: {len(names)} files, {size:,} bytes, {len(problems)} problems")
    return int(bool(problems))


if __name__ == "__main__":
    sys.exit(main())
