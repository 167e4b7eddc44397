"""Builds the wheel for 64-bit ARM Linux on a machine of another kind: ``python
packaging/aarch64_wheel.py --out dist``.

It needs maturin and ziglang, which links against any glibc, in this Python, and a Rust compiler
with the standard library of aarch64-unknown-linux-gnu. If one is missing, the message says how to
get it.
"""

import argparse
import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TARGET = "aarch64-unknown-linux-gnu"
# Debian's compiler, which need not be the first in the path.
DEBIAN_RUSTC = "/usr/bin/rustc"
STANDARD_LIBRARY = f"""no Rust compiler with the standard library of {TARGET}. Either of these brings it:
  rustup target add {TARGET}
  dpkg --add-architecture arm64; apt-get update; apt-get install rustc-web libstd-rust-web-dev:arm64   (Debian)
or name a compiler that has it: RUSTC=..."""


class MissingError(Exception):
    """Something that this machine lacks, and how to get it."""


def main() -> int:
    """Builds it. Exit codes: 0, 1 (something is missing), maturin's own."""
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("--out", type=Path, default=ROOT / "dist", help="where the wheel goes")
    options.add_argument(
        "--compatibility", default="manylinux2014", help="the oldest Linux that it is for"
    )
    given = options.parse_args()
    try:
        compiler = rustc()
        for module, package in (("maturin", "maturin"), ("ziglang", "ziglang")):
            if importlib.util.find_spec(module) is None:
                raise MissingError(f"no {package}: pip install {package}")
    except MissingError as missing:
        print(f"wheel-aarch64: {missing}", file=sys.stderr)
        return 1
    print(f"wheel-aarch64: with {compiler}")
    # A folder of its own: the usual one has build scripts of another compiler.
    environment = os.environ | {
        "RUSTC": compiler,
        "CARGO_TARGET_DIR": str(ROOT / "target" / "aarch64"),
    }
    # Maturin finds zig by this Python's name.
    environment["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), environment["PATH"]])
    command = [
        sys.executable,
        "-m",
        "maturin",
        "build",
        "--release",
        "--locked",
        "--zig",
        "--target",
        TARGET,
    ]
    command += ["--compatibility", given.compatibility, "--out", str(given.out)]
    return subprocess.run(command, cwd=ROOT, env=environment, check=False).returncode


def rustc() -> str:
    """The first compiler that can build for the target."""
    named = os.environ.get("RUSTC")
    for compiler in [named] if named else ["rustc", DEBIAN_RUSTC]:
        if shutil.which(compiler) is not None and has_standard_library(compiler):
            return compiler
    raise MissingError(STANDARD_LIBRARY)


def has_standard_library(compiler: str) -> bool:
    """Whether its folder for the target holds the standard library."""
    command = [compiler, "--print", "target-libdir", "--target", TARGET]
    said = subprocess.run(command, capture_output=True, text=True, check=False)
    return said.returncode == 0 and any(Path(said.stdout.strip()).glob("libstd-*.rlib"))


if __name__ == "__main__":
    sys.exit(main())
