"""Installs a wheel or a source distribution as a new user would, and runs the README's lines.

``python packaging/new_user.py FILE`` makes an empty virtual environment in a clean folder. Without
extras, each module must import or name in one line the extra that it needs. Then the README's lines
must run, and uninstalling must leave no files.
"""

import argparse
import re
import subprocess
import sys
import tempfile
import venv
from collections.abc import Callable
from pathlib import Path

README = Path(__file__).resolve().parents[1] / "README.md"
# The extra that each command needs, and that a plain installation lacks.
WANT = {
    "eval D.npy D.npy --truth identity": "report",
    "reproduce --quick": "report",
    "align D.npy --report page -o truth.csv": "report",
    "map build photos/monday --model network.onnx -o made.safetensors": "learned",
    "map build descriptors.h5 -o made.safetensors": "files",
    "map build drive.mp4 -o made.safetensors": "video",
    "run known.safetensors drive.mp4": "video",
    "run known.safetensors drive.mcap": "bags",
    "run known.safetensors rtsp://127.0.0.1:1/front": "camera",
    "run known.safetensors photos/tuesday --save drive.rrd": "live",
}
# They need the paper's data sets, a bag, and a browser.
LEFT_OUT = ("surefix reproduce", "drive.bag", "--open")
EXTRA = re.compile(r"pip install ['\"]surefix\[(\w+)\]['\"]")

MODULES = """
import importlib, pkgutil, surefix
for found in pkgutil.walk_packages(surefix.__path__, "surefix.", onerror=lambda name: None):
    if found.name != "surefix.__main__":
        try:
            importlib.import_module(found.name)
        except ImportError as error:
            print(found.name, error, sep="\\t")
"""
COMMANDS = """
from typer.main import get_command
from surefix.cli import app
def walk(command, path):
    print(*path)
    for name, below in getattr(command, "commands", {}).items():
        walk(below, (*path, name))
walk(get_command(app), ())
"""
# Images in a format that needs no other package: a text header, then the bytes.
PHOTOS = """
from pathlib import Path
import numpy as np
import surefix
from surefix.simulate import Route
route = Route(places=40, size=(64, 32))
for day, drive in (("monday", route.reference()), ("tuesday", route.traverse(noise=0.1))):
    folder = Path("photos", day)
    folder.mkdir(parents=True)
    for index in range(40):
        image = drive[index]
        header = f"P6 {image.shape[1]} {image.shape[0]} 255\\n".encode()
        (folder / f"{index}.ppm").write_bytes(header + np.ascontiguousarray(image).tobytes())
surefix.Map.from_images("photos/monday").save("known.safetensors")
np.save("D.npy", np.arange(64, dtype=np.float32).reshape(8, 8) % 5)
# These are never read.
for name in ("network.onnx", "descriptors.h5", "drive.mp4", "drive.mcap"):
    Path(name).touch()
"""
# A process each, so that nothing is imported yet; processor time, which depends little on other
# load.
IMPORT_TIME = """
import resource, subprocess, sys
def spent(code):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", code], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
codes = ("pass", "import numpy", "import surefix")
nothing, numpy, surefix = (1e3 * min(times) for times in zip(*[[spent(code) for code in codes] for _ in range(20)]))
print(f"import surefix {surefix - nothing:.0f} ms of processor time, of which numpy {numpy - nothing:.0f}")
"""


class FailedError(Exception):
    """A failure that a new user would have met."""


def main() -> int:
    """Tries it. Exit codes: 0, 1 (a failure for a new user)."""
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("file", type=Path, help="a wheel or a source distribution")
    file = options.parse_args().file.resolve()
    with tempfile.TemporaryDirectory() as folder:
        try:
            visit(file, Path(folder))
        except FailedError as failed:
            print(f"check-new-user: {file.name}: {failed}", file=sys.stderr)
            return 1
    return 0


def visit(file: Path, folder: Path) -> None:
    """All checks, in order."""
    venv.create(folder / "venv", with_pip=True)
    here = folder / "here"
    here.mkdir()
    binaries = folder / "venv" / ("Scripts" if sys.platform == "win32" else "bin")
    python, surefix = str(binaries / "python"), str(binaries / "surefix")

    def call(*command: str, code: int = 0) -> str:
        said = subprocess.run(
            command, cwd=here, capture_output=True, text=True, encoding="utf-8", check=False
        )
        if said.returncode != code or "Traceback" in said.stderr:
            raise FailedError(
                f"{' '.join(command)}: expected exit code {code}, got {said.returncode}: {said.stderr}"
            )
        return said.stdout if code == 0 else said.stderr

    def tell(text: str) -> None:
        print(f"check-new-user: {file.name}: {text}", flush=True)

    call(python, "-m", "pip", "install", "--quiet", str(file))
    tell("installs in an empty environment")
    for line in call(python, "-W", "error", "-c", MODULES).splitlines():
        if not EXTRA.search(line):
            raise FailedError(f"expected a word on the extra that is missing, got: {line}")
    tell("each module imports, or names the extra that it wants")
    commands = call(python, "-c", COMMANDS).splitlines()
    for command in commands:
        call(surefix, *command.split(), "--help")
    tell(f"--help of {len(commands)} commands")
    call(python, "-c", PHOTOS)
    for command, extra in WANT.items():
        said = call(surefix, *command.split(), code=1)
        if said.count("\n") != 1 or EXTRA.findall(said) != [extra]:
            raise FailedError(
                f"surefix {command}: expected one line that names surefix[{extra}], got: {said}"
            )
    tell(f"{len(WANT)} commands name the extra that they want")
    if EXTRA.findall(call(surefix, "demo", "--places", "100").splitlines()[-1]) != ["report"]:
        raise FailedError("surefix demo: expected its last line to name surefix[report]")
    tell("the demo localizes without pictures")
    call(surefix, "doctor")
    if sys.platform != "win32":
        tell(call(python, "-c", IMPORT_TIME).strip())
    call(python, "-m", "pip", "install", "--quiet", "surefix[report]")
    tried = readme_lines(call, python, surefix)
    tell(f"{tried} lines of the README run")
    call(python, "-m", "pip", "uninstall", "--yes", "surefix")
    left = [str(path.relative_to(folder)) for path in (folder / "venv").rglob("*surefix*")]
    if left:
        raise FailedError(f"left behind when it is uninstalled: {', '.join(left)}")
    tell("uninstalls, and leaves nothing")


def readme_lines(call: Callable[..., str], python: str, surefix: str) -> int:
    """Runs the README's Python and command lines; their number."""
    text = README.read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    for block in blocks:
        call(python, "-W", "error", "-c", block)
    # Comments are for the reader.
    lines = [
        line.partition(" #")[0].strip() for line in re.findall(r"^surefix .*$", text, re.MULTILINE)
    ]
    lines = [line for line in lines if not any(words in line for words in LEFT_OUT)]
    for line in lines:
        call(surefix, *line.split()[1:])
    return len(lines) + sum(len(block.splitlines()) for block in blocks)


if __name__ == "__main__":
    sys.exit(main())
