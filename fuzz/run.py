"""Build the fuzz targets with AddressSanitizer on the stable toolchain and run each for a time.

Prints a line a target; a finding ends it with exit code 1, the input and how to run it again.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
from base64 import b64encode
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

FUZZ = Path(__file__).resolve().parent
TARGETS = sorted(path.stem for path in (FUZZ / "fuzz_targets").glob("*.rs"))
# It has the checks of a debug build.
PROFILE = "fuzz"
# Those of cargo-fuzz, but that code which nothing calls is left out.
RUSTFLAGS = (
    "--cfg fuzzing -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 "
    "-Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table "
    "-Cllvm-args=-sanitizer-coverage-trace-compares -Zsanitizer=address"
)
# No input takes this long, on a busy machine either: a hang.
HANGS = 600
# Larger allocations, and more memory in all, are findings.
MIB = 2048
# The longest inputs; of the targets of structured input, which take 16 to 300 bytes, below.
LONGEST = {"image": 2048, "map": 8192, "settings": 4096, "snapshot": 8192}
ENVIRONMENT = {
    # What is refused by `try_reserve` is no finding.
    "ASAN_OPTIONS": "allocator_may_return_null=1:detect_odr_violation=0",
    "SUREFIX_MAX_IMAGE_MIB": "16",
}


def build() -> Path:
    """The folder with the program of each target."""
    about = subprocess.run(["rustc", "-vV"], check=True, capture_output=True, text=True).stdout
    host = re.findall(r"^host: (.*)$", about, re.MULTILINE)[0]
    target = Path(os.environ.get("CARGO_TARGET_DIR", FUZZ.parent / "target")).resolve()
    command = [
        "cargo",
        "build",
        "--locked",
        "--package",
        "surefix-fuzz",
        "--bins",
        "--profile",
        PROFILE,
    ]
    flags = {"RUSTC_BOOTSTRAP": "1", "RUSTFLAGS": RUSTFLAGS, "CARGO_TARGET_DIR": str(target)}
    subprocess.run([*command, "--target", host], check=True, cwd=FUZZ, env=os.environ | flags)
    return target / host / PROFILE


def fuzz(programs: Path, name: str, seconds: int) -> bool:
    """Whether a target found nothing in this time."""
    corpus, artifacts = FUZZ / "corpus" / name, FUZZ / "artifacts" / name
    for folder in (corpus, artifacts):
        folder.mkdir(parents=True, exist_ok=True)
    known = set(artifacts.iterdir())
    options = {
        "max_total_time": seconds,
        "max_len": LONGEST.get(name, 320),
        "timeout": HANGS,
        # What takes less, on however busy a machine, is no finding.
        "report_slow_units": HANGS,
        "rss_limit_mb": MIB,
        "artifact_prefix": f"{artifacts}/",
        "print_final_stats": 1,
        # Ctrl-C is no finding.
        "interrupted_exitcode": 0,
        # Its book-keeping costs more than the inputs.
        "entropic": 0,
    }
    command = [
        programs / name,
        *(f"-{key}={value}" for key, value in options.items()),
        corpus,
        FUZZ / "seeds" / name,
    ]
    done = subprocess.run(
        command, capture_output=True, text=True, errors="replace", env=os.environ | ENVIRONMENT
    )
    stats = dict(re.findall(r"^stat::(\w+):\s+(\d+)", done.stderr, re.MULTILINE))
    runs, speed, memory = (
        int(stats.get(key, 0))
        for key in ("number_of_executed_units", "average_exec_per_sec", "peak_rss_mb")
    )
    found = sorted(set(artifacts.iterdir()) - known)
    crashed = done.returncode != 0
    findings = max(len(found), crashed)
    figures = f"{runs:>13,} runs{speed:>9,} a second{memory:>7,} MB{findings:>4} findings"
    print(f"{name:10}{figures}", flush=True)
    if crashed:
        (log := artifacts / "log").write_text(done.stderr)
        tail = [line for line in done.stderr.splitlines() if "panicked" in line or "ERROR" in line]
        print("\n".join(["", *tail[:4], f"all it said: {log}"]))
        for path in found:
            print(f"again: {programs / name} {path}")
            print(f"without sanitizer: cargo run --package surefix-fuzz --bin {name} -- {path}")
            # A machine of CI, and its files, will be gone.
            print(f"the input: base64 -d <<< {b64encode(path.read_bytes()).decode()} > {path.name}")
    return not crashed


def main() -> int:
    """Exit code 1 for a finding."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "targets", nargs="*", metavar="TARGET", help=f"all by default: {', '.join(TARGETS)}"
    )
    parser.add_argument("--seconds", type=float, default=60, help="how long each runs")
    parser.add_argument("--hours", type=float, help="the same in hours")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="targets at a time")
    options = parser.parse_args()
    targets = options.targets or TARGETS
    if wrong := [name for name in targets if name not in TARGETS]:
        parser.error(f"expected of {', '.join(TARGETS)}, got {', '.join(wrong)}")
    seconds = max(1, round(options.hours * 3600 if options.hours else options.seconds))
    programs = build()
    with ThreadPoolExecutor(options.jobs) as pool:
        clean = list(pool.map(lambda name: fuzz(programs, name, seconds), targets))
    return 0 if all(clean) else 1


if __name__ == "__main__":
    sys.exit(main())
