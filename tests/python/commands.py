"""The command line for tests: in this process, or in one of its own if a process is tested."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys
from unittest import mock

from surefix import cli

# A continuous integration may ask for colours, and a desktop may have a display: neither is tested.
HIDDEN = ("FORCE_COLOR", "TTY_COMPATIBLE", "CLICOLOR_FORCE", "DISPLAY", "WAYLAND_DISPLAY")


def surefix_(
    *arguments: object, code: int | None = 0, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Runs ``surefix`` with its output in a pipe, in this process: exit code, output and errors.

    `code` is the expected exit code; `None` accepts any.
    """
    argv = ["surefix", *map(str, arguments)]
    inherited = {name: value for name, value in os.environ.items() if name not in HIDDEN}
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8") for _ in range(2))
    with (
        mock.patch.object(sys, "argv", argv),
        mock.patch.dict(os.environ, inherited | environment, clear=True),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            cli.main()
            exited = 0
        except SystemExit as end:
            exited = end.code if isinstance(end.code, int) else int(end.code is not None)
    return checked(subprocess.CompletedProcess(argv, exited, text(out), text(err)), code)


def surefix_process(
    *arguments: object, code: int | None = 0, **environment: str
) -> subprocess.CompletedProcess[str]:
    """The same in a process of its own, with every warning an error."""
    argv = [sys.executable, "-W", "error", "-m", "surefix", *map(str, arguments)]
    inherited = {name: value for name, value in os.environ.items() if name not in HIDDEN}
    done = subprocess.run(
        argv,
        capture_output=True,
        text=True,
        encoding="utf-8",
        env=inherited | environment,
        check=False,
    )
    return checked(done, code)


def checked(
    done: subprocess.CompletedProcess[str], code: int | None
) -> subprocess.CompletedProcess[str]:
    """Checks each command's exit code, and for tracebacks and control codes in a pipe."""
    if code is not None:
        assert done.returncode == code, (done.stdout, done.stderr)
    assert "Traceback" not in done.stderr, done.stderr
    assert "\x1b" not in done.stdout + done.stderr, "control codes in a pipe"
    return done


def text(stream: io.TextIOWrapper) -> str:
    stream.flush()
    assert isinstance(stream.buffer, io.BytesIO)
    return stream.buffer.getvalue().decode("utf-8")
