"""Guards the instructions of each hot piece of work: a rise is a slowdown that no other load on the
machine can hide. And the instructions of each adversary's push
(``instructions/src/adversaries.rs``): at most three times those of the usual push of the same
configuration.

``python benches/instructions.py`` runs ``instructions/`` under callgrind and compares with
``instructions.toml``; ``--accept`` writes that file anew. It needs cargo and valgrind, and says so
where it has not got them.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

HERE = Path(__file__).resolve().parent
COMMITTED = HERE / "instructions.toml"
# By how many hundredths a case may rise.
MARGIN = 2
# The instruction sets that are counted, and the arguments for each. Valgrind knows no AVX-512.
RUNS = (("avx2", ()), ("scalar", ("--few",)))
ACCEPT = "make instructions-accept"
# How many times the usual push an adversary's may cost.
BOUND = 3


class SkippedError(Exception):
    """There is nothing to compare with here, and why."""


@dataclass(frozen=True)
class Verdict:
    """What a comparison found, in lines; any in ``failures`` fails."""

    failures: Sequence[str] = ()
    notes: Sequence[str] = ()


@dataclass(frozen=True)
class Counts:
    """Instructions of one call of each case, and what they were counted with."""

    about: Mapping[str, str] = field(default_factory=dict)
    cases: Mapping[str, int] = field(default_factory=dict)


def compare(committed: Mapping[str, int], counted: Mapping[str, int]) -> Verdict:
    """Which cases rose, fell, are new or are gone."""
    failures, notes = [], []
    for name, now in counted.items():
        before = committed.get(name)
        if before is None:
            failures.append(
                f"new: {name}: {now:,} instructions, and {COMMITTED.name} has no such case"
            )
            continue
        change = now - before
        said = f"{name}: from {before:,} to {now:,} instructions ({change / before:+.1%})"
        if 100 * change > MARGIN * before:
            failures.append(f"rose: {said}")
        elif 100 * change < -MARGIN * before:
            notes.append(f"fell: {said}; {ACCEPT} guards what was won")
    gone = sorted(committed.keys() - counted)
    failures += [f"gone: {name}: {COMMITTED.name} has it, and it was not counted" for name in gone]
    return Verdict(failures, notes)


def dear(counted: Mapping[str, int]) -> Verdict:
    """Which adversaries cost more than they may, and the dearest of all. A case is named by its
    configuration and its adversary; the first of a configuration is the usual push.
    """
    failures, dearest = [], (0.0, "")
    usual: dict[str, int] = {}
    for name, now in counted.items():
        configuration, _ = name.split("; ")
        ratio = now / usual.setdefault(configuration, now)
        dearest = max(dearest, (ratio, name))
        if ratio > BOUND:
            failures.append(f"dear: {name}: {ratio:.1f} times the usual push, {now:,} instructions")
    ratio, name = dearest
    notes = [f"{len(counted)} adversaries, the dearest {ratio:.2f} times the usual push: {name}"]
    return Verdict(failures, notes)


def read(file: Path) -> Counts:
    """The committed counts."""
    text = tomllib.loads(file.read_text(encoding="utf-8"))
    return Counts(text["about"], text["instructions"])


def written(counts: Counts) -> str:
    """The file's text."""
    lines = [f"# Made by `{ACCEPT}`: instructions of one call, by case.", "", "[about]"]
    lines += [f"{name} = {json.dumps(value)}" for name, value in counts.about.items()]
    lines += ["", "[instructions]"]
    lines += [f"{json.dumps(name)} = {count}" for name, count in counts.cases.items()]
    return "\n".join(lines) + "\n"


def difference(committed: Mapping[str, str], here: Mapping[str, str]) -> str:
    """Why counts made elsewhere say nothing here; nothing where they do."""
    for name, value in here.items():
        if committed.get(name) != value:
            return f"counted with {name} {committed.get(name, 'unknown')}, here it is {value}"
    return ""


def about() -> dict[str, str]:
    """What decides how many instructions the same sources become."""
    for tool in ("cargo", "rustc", "valgrind"):
        if shutil.which(tool) is None:
            raise SkippedError(f"{tool} is not installed")
    said = subprocess.run(
        ["rustc", "-vV"], capture_output=True, text=True, check=True, cwd=HERE
    ).stdout
    found = dict(re.findall(r"^(release|host): (.+)$", said, re.MULTILINE))
    return {"rustc": found["release"], "target": found["host"]}


def build() -> Path:
    """The program, optimised as it ships."""
    # Chosen together with the binding, it shares the wheel's build: features are those of both.
    command = [
        "cargo",
        "build",
        "--locked",
        "--release",
        "--package=surefix-instructions",
        "--package=surefix-python",
        "--bin=instructions",
        "--message-format=json",
    ]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, cwd=HERE.parent)
    for line in done.stdout.splitlines():
        message = json.loads(line) if line.startswith("{") else {}
        if (
            message.get("reason") == "compiler-artifact"
            and message["target"]["name"] == "instructions"
        ):
            return Path(message["executable"])
    raise RuntimeError("cargo built no program named instructions")


def count(program: Path, isa: str, arguments: Sequence[str]) -> dict[str, int]:
    """Instructions of one call of each case, on one instruction set."""
    with tempfile.TemporaryDirectory() as folder:
        command = [
            "valgrind", "--tool=callgrind", "--quiet", f"--callgrind-out-file={folder}/out",
            "--toggle-collect=instructions::measured", "--dump-after=instructions::measured",
            str(program), *arguments,
        ]  # fmt: skip
        environment = os.environ | {"SUREFIX_ISA": isa, "RAYON_NUM_THREADS": "1"}
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
        if done.returncode:
            raise RuntimeError(f"valgrind failed with {done.returncode}:\n{done.stderr}")
        (_, used), *cases = (line.split("\t") for line in done.stdout.splitlines())
        if used != isa:
            raise SkippedError(
                f"valgrind offers no {isa} on this processor, the kernels ran on {used}"
            )
        # A numbered file for each call of `measured`, in their order; what is left at the end is in
        # one without.
        parts = sorted(Path(folder).glob("out.*"), key=lambda part: int(part.suffix[1:]))
        totals = [_total(part) for part in parts]
    return {
        f"{isa}: {name}": round(total / int(times))
        for (name, times), total in zip(cases, totals, strict=True)
    }


def _total(file: Path) -> int:
    found = re.search(
        r"^(?:summary|totals): (\d+)$", file.read_text(encoding="utf-8"), re.MULTILINE
    )
    if found is None or int(found[1]) == 0:
        raise RuntimeError(f"{file.name}: callgrind counted nothing")
    return int(found[1])


def main() -> int:
    """Compare, or accept. Exit codes: 0 (as before, fewer, or skipped), 1 (a rise, or another set
    of cases).
    """
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--accept", action="store_true", help="write instructions.toml from what is counted now"
    )
    accept = parser.parse_args().accept
    try:
        here = about()
        if not accept:
            if not COMMITTED.exists():
                raise SkippedError(f"there is no {COMMITTED.name} yet: {ACCEPT}")
            committed = read(COMMITTED)
            if why := difference(committed.about, here):
                raise SkippedError(why)
        program = build()
        counted = {
            name: n for isa, arguments in RUNS for name, n in count(program, isa, arguments).items()
        }
        bounded = dear(count(program, "avx2", ("--adversaries",)))
    except SkippedError as why:
        print(f"instructions: skipped: {why}")
        return 0
    if accept:
        COMMITTED.write_text(written(Counts(here, counted)), encoding="utf-8")
        print(f"instructions: {len(counted)} cases written to {COMMITTED.name}")
        return 0
    verdict = compare(committed.cases, counted)
    for line in (*verdict.notes, *bounded.notes, *verdict.failures, *bounded.failures):
        print(f"instructions: {line}")
    if verdict.failures:
        print(
            f"instructions: where this is meant, accept it: {ACCEPT}, and commit {COMMITTED.name}",
            file=sys.stderr,
        )
    if verdict.failures or bounded.failures:
        return 1
    print(f"instructions: {len(counted)} cases, none rose by more than {MARGIN} %")
    return 0


if __name__ == "__main__":
    sys.exit(main())
