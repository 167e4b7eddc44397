"""``surefix doctor``: what is installed here, and whether the compiled part answers right."""

import json
import os
import platform
import sys
import warnings
import webbrowser
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table
from rich.text import Text

from surefix import Map, SurefixError, __version__, match
from surefix._core import instruction_set
from surefix._extra import ABSENT, EXTRAS
from surefix._terminal import Console, say
from surefix._words import plural
from surefix.cli.flags import documented
from surefix.descriptors import HUB_MODELS
from surefix.live.viewer import viewer_obstacle
from surefix.machine import in_gb, limits_left, processor

# The self-check's places, and the noise of its queries, in grey levels.
PLACES, NOISE = 16, 20


@documented
def doctor(as_json: Annotated[bool, typer.Option("--json")] = False) -> None:
    """Say what is installed here, and check that surefix answers right.

    The exit code is 0 whatever is missing, and 1 if the check fails.

    Parameters
    ----------
    as_json: One JSON object instead of a table.
    """
    with Console(stderr=True, force_terminal=sys.stderr.isatty()).status("Looking around"):
        facts = {"version": __version__, "check": check()} | machine_facts() | extra_facts()
    if as_json:
        say(json.dumps(facts))
    else:
        _print(facts)
    if facts["check"] is not None:
        raise SurefixError(f"self-check: {facts['check']}")


def check() -> str | None:
    """What is wrong with a small run whose answers are known; None if nothing is."""
    rng = np.random.default_rng(0)
    images = rng.integers(NOISE, 256 - NOISE, (PLACES, 64, 128))
    queries = images + rng.integers(-NOISE, NOISE, images.shape)
    how: dict[str, Any] = {"progress": False}
    route = Map.from_images(images.astype(np.uint8), **how)
    drive = Map.from_images(queries.astype(np.uint8), **how)
    # Of bytes: 32 are one standard deviation of a patch.
    far = np.abs(route.descriptors[:, None].astype(int) - drive.descriptors.astype(int))
    expected = far.mean(axis=2) / 32
    got = np.stack([route.distances(row) for row in drive.descriptors], axis=1)
    if not np.allclose(got, expected, rtol=1e-5, atol=0):
        off = float(np.abs(got - expected).max())
        return f"expected the distances that NumPy computes, got others, by up to {off:.3g}"
    run = match(route, drive.descriptors, sequence_length=4, motion="steady", **how)
    # Before the third query neither the tracker nor the gradients know the motion.
    places = {"place": run.place, "single_place": run.single_place}
    for name, found in places.items():
        if found[2:].tolist() != [*range(2, PLACES)]:
            return f"{name}: expected 2 to {PLACES - 1} in order, got {found[2:].tolist()}"
    if not run.trusted[2:].all():
        return f"trusted: expected all, got {int(run.trusted[2:].sum())} of {PLACES - 2}"
    return None


def machine_facts() -> dict[str, Any]:
    """Python, the processor, memory, and what could show a drive or a page."""
    available = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else None
    return {
        "python": platform.python_version(),
        "executable": sys.executable,
        "system": f"{platform.system()} {platform.machine()}",
        "processor": processor(),
        "instruction_set": instruction_set(),
        "cores": os.cpu_count(),
        "cores_available": os.cpu_count() if available is None else len(available),
        "memory": [{"bytes": max(size, 0), "what": whose} for size, whose in limits_left()],
        # Why it cannot be opened.
        "viewer": viewer_obstacle(),
        "browser": _browser(),
        "display": _display(),
        "models": [*HUB_MODELS],
    }


def extra_facts() -> dict[str, Any]:
    """Each extra: the versions of its packages, and why one of them cannot be used."""
    seen: dict[str, tuple[str | None, str | None]] = {}
    facts: dict[str, Any] = {}
    for extra in EXTRAS.values():
        for package in extra.packages:
            if package.module not in seen:
                with warnings.catch_warnings(action="ignore"):
                    seen[package.module] = package.look()
        problems = [
            f"{package.title} {seen[package.module][1]}"
            for package in extra.packages
            if seen[package.module][1] is not None
        ]
        facts[extra.name] = {
            "for": extra.purpose,
            "packages": {each.title: seen[each.module][0] for each in extra.packages},
            "problems": problems,
            "install": extra.command,
        }
    return {"extras": facts}


def _browser() -> str | None:
    """The browser that a report would be opened in."""
    try:
        found = webbrowser.get()
    except webbrowser.Error:
        return None
    return str(getattr(found, "name", None) or type(found).__name__)


def _display() -> str | None:
    """The screen that a window would be opened on."""
    if not sys.platform.startswith("linux"):
        return "that of the system"
    names = ("DISPLAY", "WAYLAND_DISPLAY")
    return next((f"{name}={os.environ[name]}" for name in names if os.environ.get(name)), None)


def _print(facts: dict[str, Any]) -> None:
    """The facts as a table, in a pipe without its margins."""
    table = Table(show_header=False, box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column(no_wrap=True)
    terminal = sys.stdout.isatty()

    def row(name: str = "", said: str = "", style: str = "") -> None:
        if terminal:
            table.add_row(Text(name), Text(said, style))
        else:
            say(f"{name:<13}{said}".rstrip())

    wrong = facts["check"]
    cores = plural(facts["cores"], "core")
    if facts["cores_available"] != facts["cores"]:
        cores += f", {facts['cores_available']} for this process"
    row("surefix", facts["version"])
    row("self-check", "right" if wrong is None else f"wrong: {wrong}", _style(wrong is None, "red"))
    row("Python", f"{facts['python']}, {facts['executable']}")
    row("machine", f"{facts['system']}, {facts['processor']}, {cores}, {facts['instruction_set']}")
    memory = [f"{in_gb(each['bytes'])} {each['what']}" for each in facts["memory"]]
    row("memory", "; ".join(memory) or "unknown")
    row("viewer", facts["viewer"] or "rerun's can be opened", _style(facts["viewer"] is None))
    for name, lost in (("browser", "pages are not opened"), ("display", "no window opens")):
        found = facts[name]
        row(name, f"none found: {lost}" if found is None else found, _style(found is not None))
    row("models", f"{', '.join(facts['models'])}: see surefix models")
    row()
    for name, extra in facts["extras"].items():
        if extra["problems"]:
            said = f"{_lacking(extra)}: {extra['install']} ({extra['for']})"
        else:
            said = ", ".join(f"{title} {which}" for title, which in extra["packages"].items())
        row(f"[{name}]", said, _style(not extra["problems"]))
    if terminal:
        Console().print(table)


def _lacking(extra: dict[str, Any]) -> str:
    """The problems of an extra, short if none of its packages is there."""
    missing = [title for title in extra["packages"] if f"{title} {ABSENT}" in extra["problems"]]
    others = [each for each in extra["problems"] if not each.endswith(f" {ABSENT}")]
    if len(missing) == len(extra["packages"]):
        return ABSENT.removeprefix("is ")
    verb = ABSENT if len(missing) == 1 else ABSENT.replace("is", "are", 1)
    return "; ".join(([f"{', '.join(missing)} {verb}"] if missing else []) + others)


def _style(good: bool, bad: str = "yellow") -> str:
    return "green" if good else bad
