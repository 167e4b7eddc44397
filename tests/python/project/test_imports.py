"""When packages are imported: those that are not used cost no time."""

import subprocess
import sys

import pytest

HEAVY = {
    "PIL",
    "av",
    "bokeh",
    "cv2",
    "faiss",
    "h5py",
    "matplotlib",
    "onnxruntime",
    "pandas",
    "pyarrow",
    "ray",
    "rerun",
    "rosbags",
    "safetensors",
    "scipy",
    "sklearn",
    "torch",
}


def loaded(code: str) -> set[str]:
    """The packages that are there after ``code``, in a process of its own."""
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            f"import sys\n{code}\nprint(*{{name.partition('.')[0] for name in sys.modules}})",
        ],
        capture_output=True,
        text=True,
        check=True,
    )
    # The last line: the output of the code comes before.
    return set(done.stdout.splitlines()[-1].split())


def test_the_library_needs_numpy_alone() -> None:
    found = loaded("import surefix")
    assert "numpy" in found
    assert not found & (HEAVY | {"rich", "typer", "concurrent", "asyncio"})


@pytest.mark.slow
def test_parts_are_there_when_they_are_asked_for() -> None:
    parts = ["baselines", "datasets", "descriptors", "live", "plot", "post", "simulate", "frames"]
    found = loaded(
        f"import surefix\nassert all(getattr(surefix, part).__all__ for part in {parts})"
    )
    assert "numpy" in found
    assert (
        not loaded(
            "import surefix\nsurefix.frames.open, surefix.post.Pca, surefix.descriptors.Onnx"
        )
        & HEAVY
    )
    assert not loaded("from surefix import *") & HEAVY
    code = "import surefix\nassert set(dir(surefix)) >= {'Map', 'frames'}\nassert not hasattr(surefix, 'stream')"
    assert loaded(code)


@pytest.mark.parametrize("module", ["descriptors", "live", "post", "frames"])
def test_optional_packages_wait_until_they_are_used(module: str) -> None:
    assert not loaded(f"import surefix.{module}") & HEAVY


@pytest.mark.slow
@pytest.mark.parametrize("command", ["", "demo", "run", "map build"])
def test_help_needs_the_command_lines_libraries_only(command: str) -> None:
    found = loaded(
        f"sys.argv = ['surefix', *'{command}'.split(), '--help']\n"
        "from surefix.cli import main\n"
        "try: main()\n"
        "except SystemExit as end: assert not end.code"
    )
    assert {"rich", "typer"} <= found
    assert not found & HEAVY
