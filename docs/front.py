"""The pictures on the front page and in README: a demo's, a report and a terminal session.

``python docs/front.py`` draws all of them anew, ``python docs/front.py terminal`` one kind. The
session is recorded in tmux, and the report's picture is taken by Chromium; both must be installed.
"""

import io
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import pages
from rich.console import Console
from rich.text import Text

COLUMNS, ROWS = 100, 31
# Pictures of the animated session, and how long each is seen, in seconds; the last one longer.
FRAMES, SHOWN, LAST = 9, 0.45, 5.0
# Without the fonts that rich's own format loads from the network.
FORMAT = """\
<svg class="{unique_id}" viewBox="0 0 {width} {height}" xmlns="http://www.w3.org/2000/svg">
<style>
.{unique_id}-matrix {{ font-family: Menlo, Consolas, "DejaVu Sans Mono", monospace;
  font-size: {char_height}px; line-height: {line_height}px; }}
{styles}
</style>
<defs><clipPath id="{unique_id}-clip-terminal">
<rect x="0" y="0" width="{terminal_width}" height="{terminal_height}" /></clipPath>
{lines}</defs>
<rect fill="#151a21" width="{width}" height="{height}" rx="8"/>
<g transform="translate({terminal_x}, {terminal_y})" clip-path="url(#{unique_id}-clip-terminal)">
{backgrounds}<g class="{unique_id}-matrix">{matrix}</g></g>
</svg>
"""


def demo(folder: Path) -> None:
    """``montage`` and ``confidence`` of the drive of ``surefix demo``."""
    from surefix.cli import app
    from surefix.report import demo as drive

    def draw(made: drive.Demo, out: Path, *_: object) -> Path:
        for section in drive._sections(made):
            for name in {"montage.png", "confidence.png"} & set(section.pictures):
                picture = section.pictures[name]
                for ending, drawn in (("", picture.light), ("-dark", picture.dark)):
                    pages.keep(drawn, pages.IMAGES / f"{Path(name).stem}{ending}.png")
        return out

    # These pictures in place of the report, with one pair of images an outcome.
    drive.write_report, drive.PAIRS = draw, 1
    app(["demo", "-o", str(folder / "demo")], standalone_mode=False)


def report(folder: Path) -> None:
    """The page of ``surefix eval``, with one query chosen."""
    from playwright.sync_api import sync_playwright

    _drives(folder)
    _surefix(folder, "eval", "summer", "winter", "--truth", "identity", "-o", "report")
    chromium = _program("chromium", "chromium-browser", "google-chrome")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for ending, mode in (("", "light"), ("-dark", "dark")):
            tab = browser.new_page(viewport={"width": 1200, "height": 840}, color_scheme=mode)
            tab.goto((folder / "report" / "report.html").as_uri())
            tab.wait_for_selector("#explorer[data-ready]")
            tab.evaluate("document.querySelector('#explorer').scrollIntoView()")
            tab.evaluate("scrollBy(0, -20)")
            tab.keyboard.press("n")
            tab.wait_for_timeout(500)
            pages.keep(tab.screenshot(), pages.IMAGES / f"report{ending}.png")


def terminal(folder: Path) -> None:
    """``surefix run`` on a terminal, as an animated SVG."""
    _program("tmux")
    _drives(folder)
    command = "surefix run summer winter -o fixes.csv"
    screens = _record(folder, command)
    step = (len(screens) - 1) / (FRAMES - 1)
    chosen = [screens[round(step * index)] for index in range(FRAMES)]
    file = pages.IMAGES / "terminal.svg"
    svgs = [_svg(screen, f"f{i}") for i, screen in enumerate(chosen)]
    file.write_text(_animated(svgs, f"$ {command}"))
    print(f"{file}: {file.stat().st_size / 1000:.0f} kB", file=sys.stderr)


def _program(*names: str) -> str:
    found = next(filter(None, map(shutil.which, names)), None)
    return found or sys.exit(f"expected one of {', '.join(names)} to be installed, found none")


def _drives(folder: Path) -> None:
    if not (folder / "winter").exists():
        _surefix(folder, "demo", "--save-drives", ".", "--places", "300")


def _surefix(folder: Path, *arguments: str) -> None:
    subprocess.run([sys.executable, "-m", "surefix", *arguments], cwd=folder, check=True)


def _record(folder: Path, command: str) -> list[str]:
    """The different screens of a terminal while a command runs in it, with their colours."""
    # A shell, and a server of tmux, of its own.
    name = f"surefix-{os.getpid()}"
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    size = ["-x", str(COLUMNS), "-y", str(ROWS)]
    shell = ["env", f"PATH={path}", "PS1=$ ", "sh"]

    def tmux(*words: str) -> str:
        done = subprocess.run(
            ["tmux", "-L", name, "-f", os.devnull, *words],
            cwd=folder,
            check=True,
            capture_output=True,
            text=True,
        )
        return done.stdout

    tmux("new-session", "-d", *size, *shell)
    screens: list[str] = []
    try:
        tmux("send-keys", command, "Enter")
        end = time.monotonic() + 60
        while time.monotonic() < end:
            screen = tmux("capture-pane", "-e", "-p")
            # Of the view's whole frame, not of one that is being drawn.
            if "╰" in screen and screen not in screens[-1:]:
                screens.append(screen)
            if "usual pace" in screen:
                break
            time.sleep(0.05)
    finally:
        tmux("kill-server")
    return screens


def _svg(screen: str, name: str) -> str:
    console = Console(record=True, width=COLUMNS, file=io.StringIO(), color_system="truecolor")
    lines = screen.rstrip("\n").split("\n")
    for line in lines + [""] * (ROWS - len(lines)):
        console.print(Text.from_ansi(line), overflow="crop", no_wrap=True, crop=True)
    return console.export_svg(code_format=FORMAT, unique_id=name, title="")


def _animated(pictures: list[str], title: str) -> str:
    """The pictures one after the other; if the reader wants no motion, the last one."""
    last = len(pictures) - 1
    total = SHOWN * last + LAST
    rules = [".s { visibility: hidden }", f".s{last} {{ visibility: visible }}"]
    moving = []
    for index in range(len(pictures)):
        begin, end = (100 * SHOWN * at / total for at in (index, index + 1))
        before = "0% { visibility: hidden } " if index else ""
        after = f" {end:.2f}% {{ visibility: hidden }}" if index < last else ""
        shown = f"{begin:.2f}% {{ visibility: visible }}"
        rules.append(f"@keyframes k{index} {{ {before}{shown}{after} }}")
        moving.append(f".s{index} {{ animation: k{index} {total}s step-end infinite }}")
    rules.append(f"@media (prefers-reduced-motion: no-preference) {{ {' '.join(moving)} }}")
    size = re.search(r'viewBox="[^"]*"', pictures[0])[0]
    groups = [f'<g class="s s{index}">{svg}</g>' for index, svg in enumerate(pictures)]
    # The view takes the whole screen: the command has scrolled off.
    head = f'<text class="f0-matrix" x="9" y="28" fill="#c5c8c6">{title}</text>'
    style = "\n".join(rules)
    return "\n".join(
        (
            f'<svg {size} xmlns="http://www.w3.org/2000/svg"><style>\n{style}\n</style>',
            *groups,
            f"{head}</svg>\n",
        )
    )


KINDS: dict[str, Callable[[Path], None]] = {"demo": demo, "report": report, "terminal": terminal}

if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as temporary:
        for kind in sys.argv[1:] or KINDS:
            if kind not in KINDS:
                sys.exit(f"expected one of {', '.join(KINDS)}, got {kind}")
            KINDS[kind](Path(temporary))
