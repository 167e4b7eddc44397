"""Runs the wheel for 64-bit ARM under qemu, and compares its answers with this machine's, bit by
bit.

``python packaging/aarch64_answers.py dist/surefix-*_aarch64.whl`` needs qemu-user and an arm64
Python: it makes one in target/aarch64/root from Debian's packages, or uses that of the root folder
SUREFIX_ARM64_ROOT. numpy comes from PyPI. This Python must have the same surefix installed.
"""

import argparse
import difflib
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
HERE = ROOT / "target" / "aarch64"
ANSWERS = Path(__file__).with_name("answers.py")
# The interpreter, and the libraries that it and numpy load.
PACKAGES = (
    "libbz2-1.0",
    "libc6",
    "libcrypt1",
    "libexpat1",
    "libffi8",
    "libgcc-s1",
    "liblzma5",
    "libpython3.11-minimal",
    "libpython3.11-stdlib",
    "libssl3",
    "libstdc++6",
    "libuuid1",
    "python3.11-minimal",
    "zlib1g",
)
# The instruction sets of an ARM processor.
ISAS = ("neon", "scalar")


class MissingError(Exception):
    """Something that this machine lacks, and how to get it."""


def main() -> int:
    """Compares. Exit codes: 0, 1 (another answer, or something is missing)."""
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("wheel", type=Path)
    wheel = options.parse_args().wheel
    try:
        qemu = shutil.which("qemu-aarch64")
        if qemu is None:
            raise MissingError("no qemu-aarch64: apt-get install qemu-user")
        if not wheel.is_file():
            raise MissingError(f"no wheel {wheel}: make wheel-aarch64")
        root = Path(os.environ.get("SUREFIX_ARM64_ROOT") or debian_root())
        site = install(wheel)
    except MissingError as missing:
        print(f"check-aarch64: {missing}", file=sys.stderr)
        return 1
    expected = run([sys.executable])
    differ = False
    for isa in ISAS:
        guest = [qemu, "-L", str(root), "-E", f"PYTHONPATH={site}", "-E", f"SUREFIX_ISA={isa}"]
        came = run([*guest, "-E", "OPENBLAS_NUM_THREADS=1", str(root / "usr/bin/python3.11")])
        lines = difflib.unified_diff(expected, came, "this machine", f"aarch64, {isa}", lineterm="")
        different = list(lines)
        differ |= bool(different)
        print(
            "\n".join(different)
            or f"check-aarch64: {isa}: {len(came) - 1} answers, the same bits as here"
        )
    return int(differ)


def debian_root() -> Path:
    """A folder with an arm64 Python and its libraries, unpacked, not installed."""
    root, debs = HERE / "root", HERE / "debs"
    if (root / "usr/bin/python3.11").exists():
        return root
    if shutil.which("apt-get") is None or shutil.which("dpkg-deb") is None:
        raise MissingError(
            "no Debian here: name a root folder with an arm64 Python 3.11 in SUREFIX_ARM64_ROOT"
        )
    debs.mkdir(parents=True, exist_ok=True)
    command = ["apt-get", "download", *(f"{package}:arm64" for package in PACKAGES)]
    said = subprocess.run(command, cwd=debs, capture_output=True, text=True, check=False)
    if said.returncode:
        hint = "dpkg --add-architecture arm64; apt-get update"
        raise MissingError(f"no arm64 packages ({hint}):\n{said.stderr.strip()}")
    for deb in debs.glob("*.deb"):
        subprocess.run(["dpkg-deb", "-x", str(deb), str(root)], check=True)
    return root


def install(wheel: Path) -> Path:
    """Installs the wheel and its dependencies for that Python in a folder of their own."""
    site = HERE / "site"
    shutil.rmtree(site, ignore_errors=True)
    command = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "--quiet",
        "--target",
        str(site),
        "--only-binary",
        ":all:",
    ]
    command += ["--python-version", "3.11", "--implementation", "cp"]
    for glibc in ("2014", "_2_27", "_2_28"):
        command += ["--platform", f"manylinux{glibc}_aarch64"]
    subprocess.run([*command, str(wheel)], check=True)
    return site


def run(python: list[str]) -> list[str]:
    """The answers, a line each."""
    said = subprocess.run([*python, str(ANSWERS)], stdout=subprocess.PIPE, text=True, check=True)
    return said.stdout.splitlines()


if __name__ == "__main__":
    sys.exit(main())
