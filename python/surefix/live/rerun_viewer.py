"""Rerun itself: the package, and its viewer."""

import os
import shutil
import socket
import sys
import sysconfig
from importlib.util import find_spec
from typing import Any

from surefix import SurefixError
from surefix._extra import require

__all__ = ["load_rerun", "open_viewer", "viewer_obstacle"]


def load_rerun() -> Any:
    """The package rerun.

    Raises
    ------
    SurefixError
        Where it is not installed: the error says what to install.
    """
    return require("rerun", "the live view", "rerun", "surefix[live]")


def viewer_obstacle() -> str | None:
    """Why rerun's viewer cannot be opened here, in a few words; None where it can."""
    if find_spec("rerun") is None:
        return 'rerun is not installed: pip install "surefix[live]"'
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        return "rerun's viewer needs a screen, and DISPLAY names none"
    return None


def open_viewer(recording: Any, port: int, memory: str) -> None:
    """Open rerun's viewer in a window of its own, or find the one that listens at ``port``. It
    outlives the process.

    Raises
    ------
    SurefixError
        Where there is no screen to open it on, or it does not start.
    """
    if obstacle := viewer_obstacle():
        raise SurefixError(obstacle)
    chosen = os.environ.get("RUST_LOG")
    # What the viewer has to say goes to this terminal, where the drive is drawn.
    os.environ.setdefault("RUST_LOG", "error")
    try:
        load_rerun().spawn(
            # Without one, rerun takes itself for turned off, and opens nothing.
            recording=recording,
            port=port,
            connect=False,
            memory_limit=memory,
            server_memory_limit=memory,
            hide_welcome_screen=True,
            # In a virtual environment that is not activated, the shell's path does not lead to it.
            executable_path=shutil.which("rerun", path=sysconfig.get_path("scripts")),
        )
    except (RuntimeError, OSError) as error:
        raise SurefixError(f"rerun's viewer did not open: {error}") from None
    finally:
        if chosen is None:
            del os.environ["RUST_LOG"]
    # Rerun does not say whether it worked.
    try:
        socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
    except OSError as error:
        raise SurefixError(
            f"rerun's viewer did not open: nothing answers at port {port} ({error})"
        ) from None
