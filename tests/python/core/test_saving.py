"""What is saved is the old file or the new one, whoever writes it: every writer is held to the same
rules. Each system call at which one can be stopped is tried in Rust (``tests/stopped``).
"""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surefix
from surefix import Map, SurefixFileError
from surefix._core import _AtomicFile, _AtomicFolder
from surefix._saving import edited, save, written
from surefix.datasets import write_track

resource = pytest.importorskip("resource")

N = 6
ROWS = np.eye(N, dtype=np.float32)
PLACES = [[3.0 * place, 0.0] for place in range(N)]


def known() -> Map:
    return Map.from_descriptors(ROWS, positions=PLACES, origin=(48.0, 11.0))


def run() -> surefix.Run:
    return surefix.match(known(), ROWS, sequence_length=2)


def closer() -> surefix.LoopCloser:
    loops = surefix.LoopCloser(exclude=2)
    for row in ROWS:
        loops.push(row)
    return loops


def track(ending: str) -> Callable[[Path], None]:
    return lambda path: write_track(path, run(), known(), np.arange(N), form=ending)  # type: ignore


def picture(path: Path) -> None:
    surefix.plot.png(run().plot(np.arange(N)), path)


# Each takes a path, and writes more than a few bytes there.
WRITERS: dict[str, Callable[[Path], Any]] = {
    "map": lambda path: known().save(path),
    "settings": lambda path: surefix.Settings(sequence_length=5).save(path),
    "fixes": lambda path: run().to_csv(path),
    "alignment": lambda path: surefix.align(known(), ROWS).to_csv(path),
    "edges": lambda path: closer().to_csv(path),
    "pose graph": lambda path: closer().to_g2o(path, np.zeros((N, 3))),
    "csv": track("csv"),
    "json": track("json"),
    "geojson": track("geojson"),
    "tum": track("tum"),
    "kitti": track("kitti"),
    "mcap": track("mcap"),
    "picture": picture,
    "text": lambda path: save(path, "a long line of text", "cannot write the text"),
}
TEXTS = sorted({*WRITERS} - {"map", "settings"})


@pytest.fixture(params=WRITERS)
def writer(request: pytest.FixtureRequest) -> Callable[[Path], Any]:
    needed = {"mcap": "mcap", "picture": "matplotlib"}.get(request.param)
    if needed is not None:
        pytest.importorskip(needed)
    return WRITERS[request.param]


@contextmanager
def full_disk() -> Iterator[None]:
    """Files of at most four bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_links_stay_and_so_does_the_mode(writer: Callable[[Path], Any], tmp_path: Path) -> None:
    target = tmp_path / "target"
    target.write_bytes(b"old")
    target.chmod(0o600)
    (tmp_path / "link").symlink_to("target")
    (tmp_path / "out").symlink_to(tmp_path / "link")
    writer(tmp_path / "out")
    assert target.read_bytes() != b"old"
    assert target.stat().st_mode & 0o777 == 0o600
    assert (tmp_path / "out").is_symlink()
    assert (tmp_path / "link").is_symlink()
    assert names(tmp_path) == ["link", "out", "target"]


def test_a_full_disk_leaves_the_old_file(writer: Callable[[Path], Any], tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.write_bytes(b"old")
    with full_disk(), pytest.raises(SurefixFileError, match=r"out: cannot write .*large"):
        writer(out)
    assert out.read_bytes() == b"old"
    assert names(tmp_path) == ["out"]


def test_the_second_writer_is_told_of_the_first(
    writer: Callable[[Path], Any], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    first = _AtomicFile(out, False)
    with pytest.raises(SurefixFileError, match="another thread of this process is writing it"):
        writer(out)
    first.write(b"first")
    first.commit()
    assert out.read_bytes() == b"first"
    writer(out)
    assert names(tmp_path) == ["out"]


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="no /proc")
def test_what_is_open_is_written_and_not_replaced(tmp_path: Path) -> None:
    """As ``-o /dev/stdout`` of a shell that has sent that to a file."""
    out = tmp_path / "out"
    with out.open("ab") as file:
        file.write(b"before\n")
        file.flush()
        for name in TEXTS[:3]:
            WRITERS[name](Path(f"/proc/self/fd/{file.fileno()}"))
        with pytest.raises(SurefixFileError, match="expected a file, got a device or a pipe"):
            known().save(f"/proc/self/fd/{file.fileno()}")
        file.write(b"after\n")
    lines = out.read_bytes().splitlines()
    assert lines[0] == b"before"
    assert lines[-1] == b"after"
    assert len(lines) > 2 + 2 * N
    assert names(tmp_path) == ["out"]


def test_a_pipe_gets_the_rows(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    read: list[bytes] = []
    reader = threading.Thread(target=lambda: read.append((tmp_path / "pipe").read_bytes()))
    reader.start()
    run().to_csv(tmp_path / "pipe")
    reader.join()
    run().to_csv(tmp_path / "file")
    assert read == [(tmp_path / "file").read_bytes()]
    assert (tmp_path / "pipe").is_fifo()


BUSY = "is writing it at this moment: try again when that has ended"
APPEND = """
import sys, numpy as np, surefix
more = surefix.Map.from_descriptors(np.eye(4, dtype=np.float32))
done = 0
while done < 5:
    try:
        surefix.Map.append(sys.argv[1], more)
        done += 1
    except surefix.SurefixFileError as error:
        assert "is writing it at this moment" in str(error), error
"""


def test_no_append_of_several_processes_is_lost(tmp_path: Path) -> None:
    path = tmp_path / "map"
    Map.from_descriptors(np.eye(4, dtype=np.float32)).save(path)
    command = [sys.executable, "-c", APPEND, str(path)]
    processes = [subprocess.Popen(command) for _ in range(3)]
    assert [process.wait() for process in processes] == [0, 0, 0]
    assert len(Map.open(path)) == 4 + 3 * 5 * 4
    assert names(tmp_path) == ["map"]


def test_no_append_of_several_threads_is_lost(tmp_path: Path) -> None:
    path, more = tmp_path / "map", Map.from_descriptors(np.eye(4, dtype=np.float32))
    more.save(path)

    said: list[str] = []

    def append() -> None:
        done = 0
        while done < 10:
            try:
                Map.append(path, more)
                done += 1
            except SurefixFileError as error:
                said.append(str(error))

    threads = [threading.Thread(target=append) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    # Of one that has ended since it is not known who it was.
    who = "another thread of this process", "another process or thread"
    assert {*said} <= {f"{path}: cannot write the map: {each} {BUSY}" for each in who}
    assert len(Map.open(path)) == 4 + 4 * 10 * 4
    assert names(tmp_path) == ["map"]


HOLD = """
import sys, time
from surefix._core import _AtomicFile
file = _AtomicFile(sys.argv[1], True)
file.write(b"a,b\\n1,2\\n")
print("held", flush=True)
time.sleep(60)
"""


@contextmanager
def held(path: Path) -> Iterator[subprocess.Popen[str]]:
    """Another process that writes rows, and does not end."""
    command = [sys.executable, "-c", HOLD, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


@pytest.mark.skipif(sys.platform != "linux", reason="the process is known on Linux")
def test_another_process_is_named(tmp_path: Path) -> None:
    with (
        held(tmp_path / "out") as process,
        pytest.raises(SurefixFileError, match=rf"process {process.pid} \(\w+.*\) is writing it"),
    ):
        run().to_csv(tmp_path / "out")


def test_what_a_killed_writer_left_is_swept_and_rows_are_kept(tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    with held(out):
        pass
    assert names(tmp_path) == [".out.csv.part"]
    told: list[tuple[Path, bool]] = []
    with written(out, "cannot write", lambda *rows: told.append(rows)) as file:
        file.write(b"new")
    assert told == [(tmp_path / "out.part.csv", True)]
    assert (tmp_path / "out.part.csv").read_bytes() == b"a,b\n1,2\n"
    assert out.read_bytes() == b"new"
    with held(out):
        pass
    # Of no use to another writer.
    run().to_csv(out)
    assert names(tmp_path) == ["out.csv", "out.part.csv"]


def test_an_edit_of_several_steps_holds_the_file(tmp_path: Path) -> None:
    path = tmp_path / "map"
    known().save(path)
    # Of an edit that was killed.
    (tmp_path / ".map.edited.part").mkdir()
    (tmp_path / ".map.edited.part" / "map").write_bytes(b"half")
    with edited(path, "cannot write the map") as copy:
        Map.append(copy, known())
        with pytest.raises(SurefixFileError, match="another thread of this process is writing it"):
            Map.append(path, known())
        with pytest.raises(SurefixFileError, match=r"map: cannot write the map: another thread"):
            edited(path, "cannot write the map").__enter__()
        assert len(Map.open(path)) == N
        Map.open(copy).with_segments(surefix.Segments(2 * N, [N])).save(copy)
    assert Map.open(path).segments.breaks.tolist() == [N]
    assert names(tmp_path) == ["map"]


def test_an_edit_that_fails_leaves_the_file_and_names_it(tmp_path: Path) -> None:
    path = tmp_path / "link"
    known().save(tmp_path / "map")
    path.symlink_to("map")
    before = path.read_bytes()

    def edit(then: Callable[[Path], None]) -> None:
        with edited(path, "problem") as copy:
            Map.append(copy, known())
            then(copy)

    other = Map.from_descriptors(ROWS, "euclidean")
    with pytest.raises(surefix.SurefixValueError) as refused:
        edit(lambda copy: Map.append(copy, other))
    assert str(refused.value).startswith(f"{path}: ")
    with pytest.raises(KeyboardInterrupt):
        edit(lambda _: signal.raise_signal(signal.SIGINT))
    assert path.is_symlink()
    assert path.read_bytes() == before
    assert names(tmp_path) == ["link", "map"]


def interrupted(out: Path) -> Path:
    """Where the rows are after Ctrl-C."""
    told: list[Path] = []

    def write() -> None:
        with written(out, "cannot write", lambda path, _: told.append(path)) as file:
            file.write(b"rows")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write()
    (kept,) = told
    return kept


def test_a_full_disk_leaves_whole_rows(tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    told: list[Path] = []

    def write() -> None:
        with written(out, "cannot write", lambda path, _: told.append(path)) as file:
            for row in (b"ab\n", b"cd\n"):
                file.write(row)
                file.flush()

    with full_disk(), pytest.raises(SurefixFileError, match=r"out\.csv: cannot write: .*large"):
        write()
    assert [path.read_bytes() for path in told] == [b"ab\n"]


def test_rows_that_are_kept_never_replace_others(tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    (tmp_path / "out.part.csv").write_text("mine")
    kept = [interrupted(out).name for _ in range(2)]
    assert kept == ["out.part2.csv", "out.part3.csv"]
    assert (tmp_path / "out.part.csv").read_text() == "mine"


@pytest.mark.parametrize("length", [140, 250, 255])
def test_long_names_have_parts(length: int, tmp_path: Path) -> None:
    out = tmp_path / ("n" * length)
    assert interrupted(out).read_bytes() == b"rows"
    run().to_csv(out)
    known().save(out)
    Map.append(out, known())
    assert len(Map.open(out)) == 2 * N


def test_a_part_that_is_a_link_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    (tmp_path / ".out.part").symlink_to("mine")
    with pytest.raises(SurefixFileError, match=r"expected no .*\.out\.part"):
        run().to_csv(tmp_path / "out")
    assert (tmp_path / "mine").read_text() == "mine"


def test_a_private_file_is_private_while_it_is_written(tmp_path: Path) -> None:
    (tmp_path / "out").touch(mode=0o600)
    with written(tmp_path / "out", "cannot write"):
        assert (tmp_path / ".out.part").stat().st_mode & 0o777 == 0o600


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="not root")
def test_root_keeps_the_owner(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.write_bytes(b"old")
    os.chown(out, 1234, 4321)
    out.chmod(0o640)
    run().to_csv(out)
    about = out.stat()
    assert (about.st_uid, about.st_gid, about.st_mode & 0o777) == (1234, 4321, 0o640)


def fill(folder: Path, others: bool) -> None:
    folder.mkdir()
    for name in ("report.html", "curve.png", "gone.csv"):
        (folder / name).write_text("old")
    if others:
        (folder / "notes.txt").write_text("mine")
        (folder / "more").mkdir()
        (folder / "more" / "notes.txt").write_text("mine")


def report(folder: Path, number: str = "new") -> None:
    new = _AtomicFolder(folder)
    for name in ("report.html", "curve.png", "table.csv"):
        (new.path / name).write_text(number)
    new.commit(["gone.csv"], "report.html")


@pytest.mark.parametrize("others", [False, True])
def test_a_report_replaces_its_own_files_alone(others: bool, tmp_path: Path) -> None:
    folder = tmp_path / "report"
    fill(folder, others)
    folder.chmod(0o750)
    (folder / "report.html").chmod(0o600)
    report(folder)
    own = ["curve.png", "report.html", "table.csv"]
    assert names(folder) == sorted([*own, *(["more", "notes.txt"] if others else [])])
    assert {(folder / name).read_text() for name in own} == {"new"}
    assert folder.stat().st_mode & 0o777 == 0o750
    assert (folder / "report.html").stat().st_mode & 0o777 == 0o600
    assert not others or (folder / "more" / "notes.txt").read_text() == "mine"
    assert names(tmp_path) == ["report"]


def test_a_report_is_written_through_a_link_and_where_one_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "report"
    fill(folder, False)
    (tmp_path / "latest").symlink_to("report")
    monkeypatch.chdir(folder)
    report(tmp_path / "latest")
    assert Path("report.html").read_text() == "new"
    report(Path(), "newer")
    assert Path("report.html").read_text() == "newer"
    assert names(tmp_path) == ["latest", "report"]


def test_two_reports_at_once(tmp_path: Path) -> None:
    first = _AtomicFolder(tmp_path / "report")
    with pytest.raises(OSError, match="another thread of this process is writing it"):
        report(tmp_path / "report")
    first.discard()
    report(tmp_path / "report")
    assert names(tmp_path) == ["report"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_run_that_is_stopped_keeps_its_fixes(number: signal.Signals, tmp_path: Path) -> None:
    """The old file is whole, and the rows so far have the name that is said."""
    out, kept, part = (tmp_path / name for name in ("f.csv", "f.part.csv", ".f.csv.part"))
    rows = np.random.default_rng(1).random((20_000, 16), np.float32)
    np.save(tmp_path / "q.npy", rows)
    Map.from_descriptors(rows[:50]).save(tmp_path / "map")
    out.write_text("old")
    command = ["run", tmp_path / "map", tmp_path / "q.npy", "-o", out]
    with subprocess.Popen(
        [sys.executable, "-m", "surefix", *map(str, command)], stderr=subprocess.PIPE, text=True
    ) as process:
        until = time.monotonic() + 60
        while time.monotonic() < until and not (part.exists() and part.stat().st_size > 2000):
            time.sleep(0.01)
        process.send_signal(number)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert f"stopped: the rows so far are in {kept}, not in {out}\n" in said
    assert "Traceback" not in said
    assert out.read_text() == "old"
    lines = kept.read_text().splitlines()
    assert [int(line.partition(",")[0]) for line in lines[1:]] == list(range(len(lines) - 1))
    assert 10 < len(lines) < len(rows)
    assert not part.exists()
