"""The viewer is opened and told of the drive: the real program, which writes down its messages and
opens no window.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sysconfig
import time
from pathlib import Path

import numpy as np
import pytest

import surefix
from rerun_reader import Recording
from surefix.live import RerunView

rerun_cli = pytest.importorskip(
    "rerun_cli", reason='rerun is not installed: pip install "surefix[live]"'
)

PLACES = 12
DEADLINE = 60.0
ENTITIES = ("fix", "score", "distances/all", "matrix/distances")


@pytest.fixture
def scripts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of programs that has rerun's, and a home in which rerun collects nothing."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.delenv("RUST_LOG", raising=False)
    monkeypatch.delenv("CI", raising=False)  # If it is set, rerun warns of every viewer.
    folder = tmp_path / "scripts"
    folder.mkdir()
    monkeypatch.setattr(sysconfig, "get_path", lambda name: str(folder))
    return folder


def program(scripts: Path, *lines: str) -> None:
    (scripts / "rerun").write_text("\n".join(["#!/bin/sh", *lines, ""]))
    (scripts / "rerun").chmod(0o755)


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


def received(path: Path, count: int) -> Recording:
    """The recording that the viewer wrote, once it has all of it."""
    deadline = time.monotonic() + DEADLINE
    while True:
        with pytest.warns(Warning, match="no footer"):  # It is still being written.
            recording = Recording(path)
        rows = [len(recording.logged.get(entity, {})) for entity in ENTITIES]
        if rows == [count] * len(ENTITIES) or time.monotonic() > deadline:
            return recording
        time.sleep(0.1)


@pytest.mark.slow
def test_the_viewer_is_opened_and_told_what_the_file_is_told(
    scripts: Path,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    capfd: pytest.CaptureFixture[str],
) -> None:
    real = Path(rerun_cli.__file__).parent / "rerun"
    subprocess.run([real, "analytics", "disable"], check=True, capture_output=True)
    program(scripts, f"echo $$ > {tmp_path}/pid", f'exec {real} "$@" --save {tmp_path}/told.rrd')
    rows = np.random.default_rng(4).normal(size=(PLACES, 6)).astype(np.float32)
    route = surefix.Map.from_descriptors(rows)
    localizer = surefix.Localizer(route)
    try:
        with RerunView(route, save=tmp_path / "saved.rrd", spawn=True, port=free_port()) as view:
            for row in rows:
                view.update(row, localizer.push(row), localizer, latency_us=1.0)
        told = received(tmp_path / "told.rrd", PLACES)
    finally:
        os.kill(int((tmp_path / "pid").read_text()), signal.SIGTERM)
    saved = Recording(tmp_path / "saved.rrd")
    assert len(saved.logged["fix"]) == PLACES
    for entity in ENTITIES:
        assert repr(told.logged[entity]) == repr(saved.logged[entity]), "repr, since NaN is not NaN"
    assert told.layout, "the blueprint comes along"
    assert caplog.text == "", "rerun has nothing to complain of"
    assert capfd.readouterr() == ("", ""), "the terminal is the drive's"
    assert "RUST_LOG" not in os.environ


@pytest.mark.slow
def test_a_viewer_that_does_not_start_is_an_error(scripts: Path, tmp_path: Path) -> None:
    program(scripts, "exit 3")
    route = surefix.Map.from_descriptors(np.eye(4, dtype=np.float32))
    (tmp_path / "kept.rrd").write_text("kept")
    with pytest.raises(
        surefix.SurefixError, match="rerun's viewer did not open: nothing answers at port"
    ):
        RerunView(route, save=tmp_path / "kept.rrd", spawn=True, port=free_port())
    assert (tmp_path / "kept.rrd").read_text() == "kept"
