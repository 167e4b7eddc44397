"""The view of a drive on the terminal: at every size, in a pipe, without colours, and after
Ctrl-C.
"""

from __future__ import annotations

import io
import os
import pty
import re
import signal
import struct
import subprocess
import sys
import termios
import threading
from fcntl import ioctl
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from rich.console import Console

import surefix
from surefix.frames import Frame
from surefix.live import TerminalView, View
from surefix.live.binning import Bins
from surefix.simulate import Route

PLACES = 60
SIZES = [(20, 6), (20, 12), (28, 24), (40, 16), (60, 24), (80, 24), (80, 50), (132, 60)]


@pytest.fixture(scope="module")
def images() -> tuple[list[NDArray[np.uint8]], list[NDArray[np.uint8]]]:
    route = Route(places=PLACES, size=(96, 48))
    reference, revisit = route.reference(), route.revisit()
    return [reference[place] for place in range(PLACES)], [
        revisit[place] for place in range(PLACES)
    ]


def screen(width: int, height: int, file: io.StringIO | None = None, **options: object) -> Console:
    return Console(
        file=file or io.StringIO(),
        width=width,
        height=height,
        force_terminal=True,
        color_system="truecolor",
        record=True,
        _environ={"TERM": "xterm-256color"},
        **options,  # type: ignore[arg-type]
    )


def drive(
    view: TerminalView,
    route: surefix.Map,
    queries: list[NDArray[np.uint8]],
    count: int,
    motion: str | None = None,
) -> surefix.Fix:
    """Push, show, and give the last fix."""
    localizer = surefix.Localizer(route, motion=motion)
    for index, image in enumerate(queries[:count]):
        fix = localizer.push(image)
        dropped = 3 if index == 2 else 0
        view.update(
            Frame(image, None, f"q{index}.png", dropped=dropped), fix, localizer, latency_us=40.0
        )
    return fix


def last_picture(console: Console) -> list[str]:
    """The lines that were drawn last."""
    text = console.export_text(styles=False)
    return text[text.rindex("╭") :].rstrip("\n").split("\n")


@pytest.mark.parametrize("motion", [None, "any"])
@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_picture_fits_the_terminal(
    width: int,
    height: int,
    motion: str | None,
    images: tuple[list[NDArray[np.uint8]], list[NDArray[np.uint8]]],
) -> None:
    route = surefix.Map.from_images(images[0], progress=False)
    console = screen(width, height)
    with TerminalView(route, total=PLACES, console=console) as view:
        fix = drive(view, route, images[1], 40, motion)
    lines = last_picture(console)
    assert ("belief: " in "".join(lines)) == (motion is not None and height >= 16)
    assert len(lines) < height, "the cursor has a line of its own"
    assert all(len(line) == min(width, 110) for line in lines)
    assert lines[0].startswith("╭─ frame 40 of 60 "[: width - 2])
    assert f"place {fix.place}" in lines[1]
    said = "\n".join(lines)
    if height >= 12:
        assert "3 dropped" in said
        if height >= 24:
            newest = rf"{fix.frame}  +(q{fix.frame}\.png +)?{fix.place}\b"
            assert re.search(newest, said), "the newest fix is in the table"
    assert ("▀" in said) == (width >= 80 and height >= 50), "images where there is room"


def test_the_last_picture_leaves_room_for_what_follows(
    images: tuple[list[NDArray[np.uint8]], list[NDArray[np.uint8]]],
) -> None:
    route = surefix.Map.from_images(images[0], progress=False)
    console = screen(60, 20)
    with TerminalView(route, total=PLACES, console=console, spare=6) as view:
        fix = drive(view, route, images[1], 40, "any")
    lines = last_picture(console)
    assert len(lines) < 20 - 6
    assert f"place {fix.place}" in lines[1]


def test_arrows_point_at_the_place_at_the_minimum_and_at_the_gradient_peak() -> None:
    generator = np.random.default_rng(2)
    route = surefix.Map.from_descriptors(generator.normal(size=(500, 8)).astype(np.float32))
    localizer = surefix.Localizer(route, smoothing=1)
    bins = Bins(500, 76, fill=True)
    agreed = set()
    for place, noise in ((3, 1.0), (120, 0.1), (499, 1.0), (250, 0.3), (251, 0.1)):
        query = route.descriptors[place] + noise * generator.normal(size=8).astype(np.float32)
        fix = localizer.push(query)
        console = screen(80, 30)
        with TerminalView(route, console=console) as view:
            view.update(query, fix, localizer, latency_us=1.0)
        lines = [line[2:-2] for line in last_picture(console)]
        here, lowest = (k for k, line in enumerate(lines) if line.strip() == "▲")
        (peak,) = (k for k, line in enumerate(lines) if line.strip() == "▼")
        assert lines[here].index("▲") == bins.of(fix.place)
        assert lines[lowest].index("▲") == bins.of(fix.single.place)
        assert lines[peak].index("▼") == bins.of(fix.gradient.place)
        bars = lines[peak + 1 : lowest]
        heights = [sum(" ▁▂▃▄▅▆▇█".index(line[k]) for line in bars) for k in range(76)]
        assert heights[bins.of(fix.single.place)] == min(heights) == 1
        assert max(heights) == 8 * len(bars)
        smallest = np.array(
            [group.min() for group in np.split(localizer.distances, bins.first[1:])]
        )
        assert np.corrcoef(heights, smallest)[0, 1] > 0.99
        agreed.add(fix.trusted)
    assert agreed == {True, False}


def test_the_route_shows_where_fixes_were_and_which_were_trusted() -> None:
    route = surefix.Map.from_descriptors(np.eye(38, dtype=np.float32))
    localizer = surefix.Localizer(route, sequence_length=1)
    console = screen(80, 40)
    states = ["·"] * 38
    with TerminalView(route, console=console) as view:
        for place, other in ((4, 4), (5, 20), (9, 9), (30, 2)):
            query = route.descriptors[place] + np.float32(0.9) * route.descriptors[other]
            fix = localizer.push(query)
            view.update(query, fix, localizer, latency_us=1.0)
            states[fix.place] = "█" if fix.trusted else "░"
    assert {"█", "░"} <= set(states)
    assert last_picture(console)[3] == f"│ {''.join(2 * state for state in states)} │"


def test_places_of_several_segments_are_named_by_them() -> None:
    route = surefix.Map.from_descriptors(np.eye(40, dtype=np.float32), breaks=[10])
    localizer, out = surefix.Localizer(route), io.StringIO()
    queries = 1 - route.descriptors[[9, 12]]
    with TerminalView(route, console=Console(file=out, width=80)) as view:
        for query in queries:
            view.update(query, localizer.push(1 - query), localizer, 10.0)
    said = out.getvalue().splitlines()
    assert said[0].startswith("frame 0: segment 0, place 9, ")
    assert said[1].startswith("frame 1: segment 1, place 2, ")
    console = screen(80, 24)
    with TerminalView(route, console=console) as view:
        view.update(queries[1], localizer.push(1 - queries[1]), localizer, 10.0)
    picture = last_picture(console)
    assert "segment 1, place 2 (12 of 40)" in "\n".join(picture)
    # Between those of the frame, the start of a segment.
    assert picture[3].count("│") == 3


@pytest.mark.parametrize("width", [44, 80])
def test_confidence_and_belief_are_shown_along_the_route(width: int) -> None:
    generator = np.random.default_rng(6)
    rows = generator.normal(size=(500, 32)).astype(np.float32)
    route = surefix.Map.from_descriptors(rows)
    localizer = surefix.Localizer(route, motion="any")
    bins = Bins(500, width - 4, fill=True)
    spread, away = [], 0
    # From no idea to a sure one, and then along a stretch that the map lacks.
    order = [*rows[100:112], *generator.normal(size=(25, 32)).astype(np.float32)]
    for query in order:
        fix, belief = localizer.push(query), localizer.belief
        assert fix.track is not None
        assert belief is not None
        console = screen(width, 40)
        with TerminalView(route, console=console) as view:
            view.update(query, fix, localizer, latency_us=1.0)
        lines = [line[2:-2] for line in last_picture(console)]
        headline = f"place {fix.place} of 500  confidence {fix.track.confidence:.2f}"
        assert headline in lines[1]
        low, high = fix.track.interval
        label = f"belief: 95 % at {low}-{high}, off map {fix.track.off_map:.2f}"
        assert lines[3].rstrip() == (label if len(label) <= width - 4 else label[: width - 5] + "…")
        sums = [belief[part].sum() for part in np.split(np.arange(500), bins.first[1:])]
        heights = [" ▁▂▃▄▅▆▇█".index(mark) for mark in lines[4]]
        np.testing.assert_allclose(heights, 8 * np.sqrt(sums), atol=0.501)
        assert bins.of(fix.place) == lines[6].index("▲")
        spread.append(sum(height > 0 for height in heights))
        if width == 80:
            off = fix.track.off_map > 0.2
            assert ("perhaps off the map" in lines[1]) == off
            away += off
    assert spread[0] > 10, "a belief that is spread over the route is visible"
    assert min(spread) <= 3
    assert away > 3 or width < 80


def test_a_pipe_gets_the_confidence(
    images: tuple[list[NDArray[np.uint8]], list[NDArray[np.uint8]]],
) -> None:
    route = surefix.Map.from_images(images[0], progress=False)
    file = io.StringIO()
    with TerminalView(route, console=Console(file=file, width=40)) as view:
        fix = drive(view, route, images[1], 5, "steady")
    assert fix.track is not None
    said = file.getvalue().splitlines()[4]
    trust = "trusted" if fix.trusted else "not trusted"
    state = ", perhaps off the map" if fix.track.off_map > 0.2 else ""
    sure = f"confidence {fix.track.confidence:.2f}"
    assert said == f"frame 4 (q4.png): place {fix.place}, {sure}, {trust}{state}"


def test_a_pipe_gets_a_plain_line_a_fix(
    images: tuple[list[NDArray[np.uint8]], list[NDArray[np.uint8]]],
) -> None:
    route = surefix.Map.from_images(images[0], progress=False)
    file = io.StringIO()
    with TerminalView(route, console=Console(file=file, width=40)) as view:
        assert isinstance(view, View)
        fix = drive(view, route, images[1], 5)
    lines = file.getvalue().splitlines()
    assert len(lines) == 5
    trust = "trusted" if fix.trusted else "not trusted"
    assert lines[4] == f"frame 4 (q4.png): place {fix.place}, score {fix.score:.3f}, {trust}"
    assert lines[0].endswith("warming up")
    assert "\x1b" not in file.getvalue()


def test_a_fast_drive_is_drawn_a_few_times_and_in_the_end(
    images: tuple[list[NDArray[np.uint8]], list[NDArray[np.uint8]]],
) -> None:
    route = surefix.Map.from_images(images[0], progress=False)
    console = screen(80, 30)
    view = TerminalView(route, console=console)
    view.paced.pause = 3600.0
    drive(view, route, images[1], 50)
    view.close()
    view.close()
    text = console.export_text(styles=False)
    assert re.findall(r"╭─ frame (\d+)", text) == ["1", "50"]


def test_marks_differ_without_colours_and_without_unicode(
    images: tuple[list[NDArray[np.uint8]], list[NDArray[np.uint8]]],
) -> None:
    route = surefix.Map.from_images(images[0], progress=False)
    file = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    console = screen(80, 50, file, no_color=True)  # type: ignore[arg-type]
    with TerminalView(route, console=console) as view:
        drive(view, route, images[1], 40)
    file.seek(0)
    text = file.read()
    assert not re.search(r"\x1b\[[\d;]*(3|4)[0-9][\d;]*m", text), "no colours"
    assert "# trusted" in text
    assert "o not trusted" in text


@pytest.mark.parametrize("places", [2, 3, 7, 76, 77, 1000, 100_003])
@pytest.mark.parametrize("width", [1, 5, 76])
def test_a_line_of_characters_keeps_every_minimum_and_finds_every_place(
    places: int, width: int
) -> None:
    distances = np.random.default_rng(places).normal(size=places).astype(np.float32)
    bins = Bins(places, width, fill=True)
    smallest = bins.smallest(distances)
    assert smallest.shape == (width,)
    assert smallest.min() == distances.min() or places < width
    columns = [bins.of(place) for place in range(places)]
    assert columns == sorted(columns)
    assert smallest[columns[int(distances.argmin())]] == distances.min()
    for place in range(0, places, max(1, places // 50)):
        assert smallest[columns[place]] <= distances[place]


@pytest.mark.parametrize("places", [2, 5, 999, 1000, 1001, 54_321])
def test_bins_of_one_width_keep_every_minimum(places: int) -> None:
    distances = np.random.default_rng(places).integers(0, 9, places).astype(np.float32)
    bins = Bins(places, 1000)
    assert len(bins) <= 1000
    want = [distances[start : start + bins.width].min() for start in range(0, places, bins.width)]
    assert bins.smallest(distances).tolist() == want
    assert bins.of(places - 1) == len(bins) - 1
    assert bins.of(int(distances.argmin())) == int(np.argmin(want))


def run_on_a_terminal(
    arguments: list[str], until: bytes | None, width: int = 80, height: int = 30, **environment: str
) -> tuple[int, str]:
    """`surefix` on a terminal, interrupted once it has shown ``until``; its exit code, and the
    text that it drew.
    """
    leader, follower = pty.openpty()
    ioctl(follower, termios.TIOCSWINSZ, struct.pack("HHHH", height, width, 0, 0))
    clean = {
        name: value
        for name, value in os.environ.items()
        if name not in ("COLUMNS", "LINES", "DISPLAY", "NO_COLOR")
    }
    process = subprocess.Popen(
        [sys.executable, "-m", "surefix", *arguments],
        stdin=follower,
        stdout=follower,
        stderr=follower,
        env=clean | {"TERM": "xterm-256color"} | environment,
    )
    os.close(follower)
    seen = b""
    # A text that never shows would be waited for without end.
    watch = threading.Timer(60, process.kill)
    watch.start()
    while True:
        try:
            chunk = os.read(leader, 65536)
        except OSError:
            break
        if not chunk:
            break
        seen += chunk
        if until is not None and until in seen:
            until = None
            process.send_signal(signal.SIGINT)
    watch.cancel()
    os.close(leader)
    return process.wait(timeout=60), seen.decode()


@pytest.fixture(scope="module")
def drives(
    tmp_path_factory: pytest.TempPathFactory,
    images: tuple[list[NDArray[np.uint8]], list[NDArray[np.uint8]]],
) -> Path:
    folder = tmp_path_factory.mktemp("drives")
    for name, drive_ in zip(("summer", "winter"), images, strict=True):
        (folder / name).mkdir()
        for index, image in enumerate(drive_):
            Image.fromarray(image).save(folder / name / f"frame{index}.png")
    surefix.Map.from_images(str(folder / "summer"), progress=False).save(
        folder / "route.safetensors"
    )
    return folder


@pytest.mark.slow
def test_ctrl_c_leaves_the_terminal_whole(drives: Path) -> None:
    arguments = ["run", str(drives / "route.safetensors"), str(drives / "winter"), "--follow"]
    code, text = run_on_a_terminal(arguments, until=b"frame59.png")
    assert code == 0, f"a folder that grows is ended so: {text[-3000:]}"
    assert text.rindex("\x1b[?25h") > text.rindex("\x1b[?25l"), "the cursor is there again"
    after = text[text.rindex("\x1b[?25h") :]
    assert "60 fixes" in after
    assert "╭" not in after
    assert "Traceback" not in text


@pytest.mark.slow
def test_live_without_rerun_says_so_in_one_line_and_shows_the_drive(drives: Path) -> None:
    block = "import sys; sys.modules['rerun'] = None; from surefix.cli import main; main()"
    (drives / "blocked").mkdir(exist_ok=True)
    (drives / "blocked" / "sitecustomize.py").write_text(
        "import sys\nsys.modules['rerun'] = None\n"
    )
    arguments = ["run", str(drives / "route.safetensors"), str(drives / "winter"), "--live"]
    code, text = run_on_a_terminal(arguments, until=None, PYTHONPATH=str(drives / "blocked"))
    assert code == 0
    assert (
        text.count(
            '--live: rerun is not installed: pip install "surefix[live]" (on the terminal instead)'
        )
        == 1
    )
    assert "frame 60 of 60" in text
    command = [sys.executable, "-c", block, *arguments[:-1], "--save", str(drives / "a.rrd")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert 'pip install "surefix[live]"' in done.stderr


@pytest.mark.slow
def test_no_color_is_respected(drives: Path) -> None:
    arguments = ["run", str(drives / "route.safetensors"), str(drives / "winter")]
    code, text = run_on_a_terminal(arguments, until=None, NO_COLOR="1", height=60)
    assert code == 0
    assert "frame 60 of 60" in text
    assert not re.search(r"\x1b\[[\d;]*(38|48|3[0-7]|9[0-7])[\d;]*m", text)
    coloured = run_on_a_terminal(arguments, until=None, height=60, COLORTERM="truecolor")[1]
    assert re.search(r"\x1b\[[\d;]*38;2", coloured)


@pytest.mark.slow
@pytest.mark.parametrize(("width", "height"), [(60, 20), (44, 24), (120, 30)])
def test_the_headline_stays_above_whatever_is_said_in_the_end(
    width: int, height: int, drives: Path
) -> None:
    lines = [f"{index},{3 * index}" for index in range(60)]
    (drives / "wheels.csv").write_text("\n".join(["time,distance", *lines]))
    drive = str(drives / "winter")
    arguments = [
        "run",
        str(drives / "route.safetensors"),
        drive,
        "--accept",
        "0.9",
        "--stride",
        "2",
    ]
    code, text = run_on_a_terminal(arguments, until=None, width=width, height=height)
    assert code == 0
    last = re.sub(r"\x1b\[[\d;?]*[A-Za-z]", "", text[text.rindex("╭─") :]).rstrip()
    assert "not kept: add -o fixes.csv" in last
    shown = sum(max(1, -(-len(line) // width)) for line in last.splitlines())
    assert shown < height, last
    assert "place " in last.splitlines()[1]


@pytest.mark.slow
def test_loops_on_a_terminal_are_counted_and_not_listed(drives: Path, tmp_path: Path) -> None:
    arguments = ["loops", str(drives / "winter"), "--exclude", "5", "--confidence", "0.01"]
    code, text = run_on_a_terminal([*arguments, "--lasting", "1"], until=None)
    assert code == 0
    plain = re.sub(r"\x1b\[[\d;?]*[A-Za-z]", "", text)
    assert "frame,place,confidence" not in plain
    assert "Closing" in plain
    assert re.search(r"60 frames, [1-9]\d* edges in ", plain)
    assert "not kept: add -o loops.csv" in plain
    kept = [*arguments, "--lasting", "1", "-o", str(tmp_path / "loops.csv")]
    code, text = run_on_a_terminal(kept, until=None)
    assert "not kept" not in text
    assert len((tmp_path / "loops.csv").read_text().splitlines()) > 2
