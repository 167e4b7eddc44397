"""``--ray``: the files and the words of each command are those without it, to the last bit."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from commands import HIDDEN, surefix_
from surefix import _ray

for package in ("matplotlib", "pyarrow", "ray"):
    pytest.importorskip(package, exc_type=ModuleNotFoundError)
pytestmark = pytest.mark.slow

PLACES, QUERIES = 60, 50


@pytest.fixture
def folder(ray_cluster: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder, with the distances of two techniques."""
    random = np.random.default_rng(0)
    for name in ("sad", "netvlad"):
        D = random.random((PLACES, QUERIES)).astype(np.float32)
        near = np.flatnonzero(random.random(QUERIES) < 0.6)
        D[near, near] -= 0.5
        np.save(tmp_path / f"{name}.npy", D)
    np.save(tmp_path / "truth.npy", np.arange(QUERIES))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def both(*arguments: object) -> list[str]:
    """The outputs without and with ``--ray``; ``OUT`` is the file or folder of each."""
    outputs = []
    for out, more in (("serial", []), ("spread", ["--ray"])):
        given = [str(each).replace("OUT", out) for each in arguments]
        done = surefix_(*given, *more, code=None)
        said = done.stdout + done.stderr
        outputs.append(re.sub(r"in [0-9.]+ s", "in a while", said.replace(out, "OUT")))
    assert outputs[0] == outputs[1]
    return outputs


def same_tables(but: str = "") -> int:
    """How many tables both runs wrote, each the same."""
    names = [path.name for path in sorted(Path("serial").glob("*.csv")) if path.name != but]
    for name in names:
        assert Path("serial", name).read_bytes() == Path("spread", name).read_bytes(), name
    return len(names)


def test_eval_with_scenarios(folder: Path, undrawn: None) -> None:
    methods = [f"--method={name}" for name in ("weighted", "single", "track_any")]
    scenarios = ["--scenario=recorded", "--scenario=speeds"]
    both("eval", "sad.npy", "--truth=identity", "-o", "OUT", *methods, *scenarios)
    assert same_tables() >= 3


def test_eval_of_more_than_is_held(
    folder: Path, undrawn: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    from surefix.tables import columns

    monkeypatch.setattr(columns, "HELD", 1)
    methods = [f"--method={name}" for name in ("weighted", "ratio", "track_any", "seqslam")]
    (said, _) = both("eval", "sad.npy", "--truth=identity", "-o", "OUT", *methods)
    assert "as they are needed" in said
    assert same_tables() >= 3


def test_compare(folder: Path) -> None:
    methods = ["--method=weighted", "--method=track_any"]
    (said, _) = both("compare", "sad.npy", "netvlad.npy", "--truth=identity", *methods)
    assert said.count("\n") > 10


def test_tune(folder: Path) -> None:
    both("tune", "sad.npy", "--fuse=netvlad.npy", "--truth=identity", "-o", "OUT.toml")
    assert Path("serial.toml").read_bytes() == Path("spread.toml").read_bytes()


def test_reproduce(folder: Path, undrawn: None, light_only: None) -> None:
    from surefix.reproduce import Settings, matrix_case
    from surefix.reproduce.break_even import break_even
    from surefix.reproduce.sweeps import ablation, weight_sweep
    from surefix.reproduce.table import table_1

    def rows() -> list[Any]:
        settings, given = Settings(quick=True), ("sad.npy", "netvlad.npy")
        cases = _ray.hold([matrix_case(f"route/{name}={name},truth.npy") for name in given])
        made = [make(cases, settings) for make in (weight_sweep, break_even, ablation)]
        return [table_1(cases, None, settings).rows, *(each.rows for each in made)]

    serial = rows()
    with _ray.tasks():
        assert rows() == serial


@pytest.mark.parametrize("deep", [False, True], ids=["8 bits", "16 bits"])
def test_map_build(folder: Path, deep: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Some images cannot be read, and the last task has one that can."""
    from surefix.descriptors import spread

    monkeypatch.setattr(spread, "STRETCH", 8)
    random = np.random.default_rng(1)
    Path("day").mkdir()
    for k in range(33):
        dtype = np.uint16 if deep else np.uint8
        image = random.integers(0, 60000 - 900 * k if deep else 256, (32, 64), dtype)
        Image.fromarray(image).save(f"day/{k:02}.png")
    for k in (0, 8, 9, 20):
        Path(f"day/{k:02}.png").write_bytes(b"no image")
    np.savetxt("gps.csv", 1e4 * random.random((33, 2)), delimiter=",")
    more = ["--thumbnails", "--positions=gps.csv", "--break=16"]
    (said, _) = both("map", "build", "day", "-o", "OUT.safetensors", *more)
    assert "29 places" in said
    assert "4 bad frames passed over" in said
    assert Path("serial.safetensors").read_bytes() == Path("spread.safetensors").read_bytes()
    Image.fromarray(np.zeros((16, 64), np.uint8)).save("day/31.png")
    (said, _) = both("map", "build", "day", "-o", "OUT.safetensors")
    assert "expected 64 x 32 pixels like the ones before it, got 64 x 16" in said
    (said, _) = both("map", "build", "day", "-o", "OUT.safetensors", "--strict")
    assert "day/00.png" in said


def test_map_build_by_a_network_goes_on_from_its_cache(folder: Path) -> None:
    pytest.importorskip("onnxruntime", exc_type=ModuleNotFoundError)
    import tiny_network

    tiny_network.save(folder / "tiny.onnx", outputs=("mean",))
    random = np.random.default_rng(1)
    Path("day").mkdir()
    for k in range(21):
        Image.fromarray(random.integers(0, 256, (24, 32, 3), np.uint8)).save(f"day/{k:02}.png")
    Path("day/05.png").write_bytes(b"no image")
    model = ["--model=tiny.onnx", "--size=32x24", "--batch=4", "--cache=OUT.cache"]
    for _ in range(2):
        both("map", "build", "day", "-o", "OUT.safetensors", *model)
        assert Path("serial.safetensors").read_bytes() == Path("spread.safetensors").read_bytes()
        # The second run goes on: its images are more.
        for k in range(21, 30):
            Image.fromarray(random.integers(0, 256, (24, 32, 3), np.uint8)).save(f"day/{k}.png")


def test_an_error_in_a_task_is_that_of_the_command(folder: Path) -> None:
    (said, _) = both("compare", "sad.npy", "netvlad.npy", "--truth=identity", "-L", "99")
    assert said.startswith("Usage: ") or said.count("\n") == 1
    assert "sequence" in said
    lost = {"RAY_ADDRESS": "127.0.0.1:1"}
    ray = pytest.importorskip("ray")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ray, "is_initialized", lambda: False)
        done = surefix_("tune", "sad.npy", "--truth=identity", "--ray", code=1, **lost)
    there = "there is no cluster: Connection refused"
    assert done.stderr == f"surefix: RAY_ADDRESS 127.0.0.1:1: {there}\n"


STUDY = """
samples = 2000

[[route]]
name = "loop"
truth = "identity"

[[descriptor]]
name = "sad"
file = "sad.npy"

[settings]
sequence_length = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]
weight = [0.0, 0.5, 1.0]
"""


def test_a_study_by_ray_is_stopped_and_goes_on(folder: Path, ray_cluster: str) -> None:
    Path("study.toml").write_text(STUDY)
    argv = [sys.executable, "-W", "error", "-m", "surefix", "study", "study.toml", "-o", "spread"]
    inherited = {name: value for name, value in os.environ.items() if name not in HIDDEN}
    inherited |= {"RAY_ADDRESS": ray_cluster}
    how = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen([*argv, "--ray"], env=inherited, **how) as running:  # type: ignore[call-overload]
        while not list(Path("spread/ready").glob("*.npz")) and running.poll() is None:
            time.sleep(0.05)
        running.send_signal(signal.SIGINT)
        _, err = running.communicate(timeout=60)
    assert running.returncode == 130, err
    kept, end = err.splitlines()
    assert kept.endswith("kept: the same command goes on")
    assert end == "surefix: interrupted"
    assert not Path("spread/results.parquet").exists()
    surefix_("study", "study.toml", "-o", "spread", "--ray")
    surefix_("study", "study.toml", "-o", "serial")
    assert (
        Path("serial/results.parquet").read_bytes() == Path("spread/results.parquet").read_bytes()
    )
