"""Seeing a drive as it goes: in the rerun viewer, in a recording for later, or on the terminal.

A view takes each frame with its fix, between two pushes::

    with TerminalView(route) as view:
        for frame in frames:
            start = time.perf_counter()
            fix = localizer.push(frame)
            view.update(frame, fix, localizer, 1e6 * (time.perf_counter() - start))

``RerunView`` needs rerun, ``pip install "surefix[live]"``; ``TerminalView`` needs nothing more.
"""

from surefix.live.rerun import RerunView
from surefix.live.terminal import TerminalView
from surefix.live.view import View

__all__ = ["RerunView", "TerminalView", "View"]
