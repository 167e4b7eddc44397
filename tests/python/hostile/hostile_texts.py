"""Hostile tables: settings, truths, positions, trajectories, fixes and pairs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hostile_files import Make, device, pipe, sparse, subfolder, written
from hostile_maps import command
from hostile_row import ANY, COMMAND, FILE, VALUE, Row

import surefix
from surefix.frames import Odometry
from surefix.tables.positions import read_positions
from surefix.tables.reports import read_fixes
from surefix.tables.truth import read_truth


def truth(path: Path) -> object:
    return read_truth(path, 10, 10)


LAUGHS = (
    '<?xml version="1.0"?><!DOCTYPE gpx [<!ENTITY a "aaaaaaaaaa">'
    + "".join(f'<!ENTITY {chr(98 + i)} "{("&" + chr(97 + i) + ";") * 10}">' for i in range(9))
    + "]><gpx>&j;</gpx>"
)
OUTSIDE = '<?xml version="1.0"?><!DOCTYPE gpx [<!ENTITY a SYSTEM "file:///etc/hostname">]><gpx><name>&a;</name></gpx>'
LINE = b"1," * 3_000_000
DIGITS = "9" * 100_000


def of(name: str) -> dict[str, tuple[Make, str, str]]:
    """Hostile files of every kind of table, with this name."""
    return {
        "a pipe": (pipe(name), FILE, "expected a file, got a pipe"),
        "a device": (device(name), FILE, "expected a file, got a device"),
        "a folder": (subfolder(name), FILE, "expected a file, got a folder"),
        "200 GB of one line": (sparse(name), ANY, "memory|needs|at most"),
        "no text": (written(name, bytes(range(128, 256)) * 4), ANY, "UTF-8|utf-8"),
    }


def rows(door: str, open_: Any, name: str) -> list[Row]:
    # A folder of positions is one of images that have them in their names.
    kinds = {
        what: row for what, row in of(name).items() if (door[:9], what) != ("positions", "a folder")
    }
    return [Row(f"{door}: {what}", open_, *row) for what, row in kinds.items()]


def toml(door: str) -> list[Row]:
    name = "route.toml"
    others: dict[str, tuple[Make, str, str]] = {
        "a pipe": (pipe(name), FILE, "expected a file, got a pipe"),
        "a device": (device(name), FILE, "expected a file, got a device"),
        "a folder": (subfolder(name), FILE, "[Ii]s a directory"),
        "200 GB": (sparse(name), FILE, "at most 1048576 bytes"),
        "no text": (written(name, bytes(range(128, 256))), FILE, "utf-8"),
        "a megabyte of lists": (written(name, "a = [" + "[" * 1_000_000), VALUE, "settings:"),
        "500,000 numbers": (written(name, "[config]\nspeeds = [" + "1," * 500_000 + "]"), "", ""),
        "a number of 100,000 digits": (written(name, "[config]\nsequence_length = " + DIGITS), VALUE, "settings:"),
        "80,000 tables": (written(name, "".join(f"[a{i}]\n" for i in range(80_000))), VALUE, "settings:"),
    }  # fmt: skip
    return [Row(f"{door}: {what}", surefix.Settings.open, *row) for what, row in others.items()]


TEXTS = [
    *toml("settings"),
    *rows("truth, json", truth, "truth.json"),
    *rows("truth, csv", truth, "truth.csv"),
    *rows("positions, csv", read_positions, "gps.csv"),
    *rows("positions, gpx", read_positions, "gps.gpx"),
    *rows("trajectory, tum", Odometry.from_file, "drive.tum"),
    *rows("odometry, csv", Odometry.from_file, "odometry.csv"),
    *rows("fixes, csv", read_fixes, "fixes.csv"),
    Row("truth, json: a list in a list 100,000 times", truth, written("t.json", "[" * 100_000), VALUE, "a list in JSON"),
    Row("truth, json: a number of 100,000 digits", truth, written("t.json", f"[{DIGITS}]"), VALUE, "a list in JSON|expected"),
    Row("truth, json: numbers beyond floats", truth, written("t.json", "[1e999, -1e999]"), VALUE, "expected"),
    Row("truth, csv: one line of 6 MB", truth, written("t.csv", LINE), VALUE, "expected"),
    Row("truth, csv: a cell of 6 MB", truth, written("t.csv", b"query,reference\n0," + b"9" * 6_000_000), VALUE, "expected"),
    Row("truth, csv: a quote without an end", truth, written("t.csv", b'query,reference\n0,"' + b"9" * 200_000), VALUE, "expected"),
    Row("truth: another ending", truth, pipe("truth.exe"), VALUE, "truth: expected"),
    Row("positions, csv: one line of 6 MB", read_positions, written("gps.csv", LINE), VALUE, "expected"),
    Row("positions, csv: a header of 6 MB", read_positions, written("gps.csv", b"x" * 6_000_000 + b"\n1\n"), VALUE, "expected"),
    Row("positions, gpx: a billion laughs", read_positions, written("gps.gpx", LAUGHS), VALUE, "a GPX file"),
    Row("positions, gpx: another file", read_positions, written("gps.gpx", OUTSIDE), VALUE, "a GPX file"),
    Row("positions, gpx: 200,000 elements in each other", read_positions, written("gps.gpx", "<a>" * 200_000), VALUE, "a GPX file"),
    Row("odometry, csv: one line of 6 MB", Odometry.from_file, written("o.csv", LINE), VALUE, "expected"),
    Row("odometry, csv: times of 100,000 digits", Odometry.from_file, written("o.csv", f"time,x,y\n{DIGITS},0,0\n1,1,1\n"), VALUE, "expected"),
    Row("trajectory, tum: one line of 6 MB", Odometry.from_file, written("o.tum", LINE.replace(b",", b" ")), VALUE, "expected"),
    Row("fixes, csv: one line of 6 MB", read_fixes, written("f.csv", LINE), VALUE, "expected"),
    Row("fixes, csv: a cell of 6 MB", read_fixes, written("f.csv", b"query," + b"x" * 6_000_000 + b"\n"), VALUE, "expected"),
    Row("fixes, jsonl: a list in a list 100,000 times", read_fixes, written("f.jsonl", "[" * 100_000), VALUE, "a JSON object a line"),
    Row("fixes, jsonl: a device", read_fixes, device("f.jsonl"), FILE, "got a device"),
    Row("run --config: a pipe", command("run", "a", "b", "--config", "{}"), pipe("route.toml"), COMMAND, "got a pipe"),
    Row("run --config: 200 GB", command("run", "a", "b", "--config", "{}"), sparse("route.toml"), COMMAND, "at most"),
    Row("compare: a pipe", command("compare", "{}", "{}"), pipe("fixes.csv"), COMMAND, "pipe|expected"),
    Row("eval --truth: a pipe", command("eval", "{}", "{}", "--truth", "{}"), pipe("truth.csv"), COMMAND, "pipe|expected"),
]  # fmt: skip
