"""Rerun itself: the package, and its viewer."""

import os
import shutil
import sys
import sysconfig
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from surefix import SurefixError

__all__ = ["has_rerun", "load_rerun", "open_viewer"]


def has_rerun() -> bool:
    """Whether rerun is installed."""
    return find_spec("rerun") is not None


def load_rerun() -> Any:
    """The package rerun.

    Raises
    ------
    SurefixError
        Where it is not installed: the error says what to install.
    """
    try:
        import rerun
    except ImportError as error:
        raise SurefixError(f'the live view needs rerun ({error}): pip install "surefix[live]"') from None
    return rerun


def open_viewer(rr: Any, port: int, memory: str) -> None:
    """Open rerun's viewer in a window of its own, or find the one that listens at ``port``. It outlives the process.

    Raises
    ------
    SurefixError
        Where there is no screen to open it on, or it does not start.
    """
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise SurefixError("rerun's viewer needs a screen, and there is none here (no DISPLAY): save the drive instead")
    # In a virtual environment that is not activated, the shell's path does not lead to it.
    beside = shutil.which("rerun", path=sysconfig.get_path("scripts"))
    try:
        rr.spawn(
            port=port,
            connect=False,
            memory_limit=memory,
            server_memory_limit=memory,
            hide_welcome_screen=True,
            executable_path=None if beside is None else str(Path(beside)),
        )
    except (RuntimeError, OSError) as error:
        raise SurefixError(f"rerun's viewer did not open: {error}") from None
