"""Hostile maps, snapshots and statistics."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from hostile_files import (
    HUGE,
    RECORD,
    Make,
    archive,
    bound_socket,
    device,
    pipe,
    sparse,
    subfolder,
    written,
)
from hostile_row import ANY, COMMAND, FILE, VALUE, Row

import surefix
from commands import surefix_
from surefix.post import Running

ONE = {"descriptors": ("F32", (2, 2))}


def many() -> str:
    """140,000 empty tensors."""
    each = (f'"{i}":{{"dtype":"U8","shape":[0],"data_offsets":[0,0]}}' for i in range(140_000))
    return "{" + ",".join(each) + "}"


def axes() -> str:
    """A tensor of 2.6 million axes."""
    return json.dumps({"a": {"dtype": "U8", "shape": [1] * 2_600_000, "data_offsets": [0, 1]}})


def steps() -> dict[str, Any]:
    """200,000 steps of post-processing."""
    return {**RECORD, "post": [{"step": "normalize"}] * 200_000}


def nested() -> str:
    """2 million lists in each other."""
    return '{"a":' + "[" * 2_000_000 + "]" * 2_000_000 + "}"


def entries() -> str:
    """400,000 entries of metadata."""
    return json.dumps({"__metadata__": {str(i): "" for i in range(400_000)}})


def recipe() -> dict[str, Any]:
    """The recipe of a network, of 2.6 million numbers."""
    return {**RECORD, "learned": {"name": "x", "all": [0] * 2_600_000}}


# Of each file: what makes it, the class of the error, and a pattern in the text.
FILES: dict[str, tuple[Make, str, str]] = {
    "names of 200 GB": (
        archive({**ONE, "names": ("U8", (HUGE,))}), ANY, "memory|names"),
    "positions of 200 GB": (
        archive({**ONE, "positions": ("F64", (HUGE // 16, 2))}), ANY, "positions: expected|memory"),
    "norms of 200 GB": (
        archive({**ONE, "norms": ("F64", (HUGE // 8,))}, {**RECORD, "metric": "cosine"}), ANY, "norms: expected|memory"),
    "breaks of 200 GB": (
        archive({**ONE, "breaks": ("U64", (HUGE // 8,))}), ANY, "memory|breaks"),
    "links of 200 GB": (
        archive({**ONE, "links": ("U64", (HUGE // 16, 2))}), ANY, "memory|links"),
    "a list of blank places of 200 GB": (
        archive({**ONE, "blank": ("U8", (HUGE,))}), ANY, "blank: expected|memory"),
    "thumbnails of 200 GB": (
        archive({**ONE, "thumbnails": ("U8", (2, 100_000, 1_000_000))}), ANY, "memory"),
    "thumbnails of another number": (
        archive({**ONE, "thumbnails": ("U8", (3, 1, 1))}), VALUE, "thumbnails: expected"),
    "rows of further traverses of 200 GB": (
        archive({**ONE, "traverse.descriptors": ("F32", (HUGE // 8, 2)), "traverse.labels": ("U8", (4,))}), ANY, "memory|traverse"),
    "labels of 200 GB": (
        archive({**ONE, "traverse.labels": ("U8", (HUGE,))}), ANY, "memory|labels"),
    "a matrix of 200 GB": (
        archive({**ONE, "post.0.matrix": ("F32", (2, HUGE // 8))}, {**RECORD, "post": [{"step": "pca", "dim": 2, "whiten": False}]}), ANY, "memory|post"),
    "140,000 empty tensors": (
        archive({}, header=many), VALUE, "at most 1024 tensors"),
    "a tensor of 2.6 million axes": (
        archive({}, header=axes), VALUE, "at most 8 axes"),
    "400,000 entries of metadata": (
        archive({}, header=entries), VALUE, "at most 64 entries"),
    "200,000 steps": (archive(ONE, steps), VALUE, "at most 64 steps"),
    "a recipe of 2.6 million numbers": (archive(ONE, recipe, data=b"\0\0\x80?" * 4), "", ""),
    "a header of nested lists": (archive({}, header=nested), VALUE, "not a safetensors file"),
    "a header longer than the bound": (
        archive({}, header=lambda: " " * (9 << 20)), VALUE, "a header of 9437184 bytes"),
    "a header longer than the file": (archive(ONE, length=1 << 62), VALUE, "a header of"),
    "a header of 2^64 - 1 bytes": (archive(ONE, length=(1 << 64) - 1), VALUE, "a header of"),
    "tensors that overflow": (
        archive({}, header='{"a":{"dtype":"F64","shape":[4294967296,4294967296],"data_offsets":[0,0]}}'), VALUE, "not a safetensors file"),
    "offsets beyond the file": (
        archive({}, header='{"a":{"dtype":"U8","shape":[9000000000],"data_offsets":[0,9000000000]}}'), VALUE, "bytes after the header"),
    "one of another program": (
        archive({}, header='{"a":{"dtype":"U8","shape":[0],"data_offsets":[0,0]}}'), VALUE, "some other program"),
    "a newer one": (archive(ONE, {**RECORD, "version": 99}), VALUE, "upgrade surefix"),
    "rows without numbers": (archive({"descriptors": ("F32", (1 << 40, 0))}), VALUE, "expected|descriptors"),
    "zeros of 200 GB": (sparse("route.safetensors"), VALUE, "not a safetensors file"),
    "an empty file": (written("route.safetensors", b""), VALUE, "0 bytes"),
}  # fmt: skip
# Those that a mapped map reads when it needs them.
LATE: dict[str, tuple[Make, str, str]] = {
    "rows of 200 GB": (archive({"descriptors": ("F32", (HUGE // 8, 2))}), ANY, "memory"),
    "rows of bytes of 200 GB": (archive({"descriptors": ("U8", (HUGE // 2, 2))}), ANY, "memory"),
}
NOT_FILES: dict[str, tuple[Make, str]] = {
    "a pipe": (pipe("route.safetensors"), "expected a file, got a pipe"),
    "a device": (device("route.safetensors"), "expected a file, got a device"),
    "a socket": (bound_socket("route.safetensors"), "expected a file, got a socket"),
    "a folder": (subfolder("route.safetensors"), "[Ii]s a directory"),
}
MORE = np.ones((2, 2), np.float32)


def mapped(path: Path) -> object:
    return surefix.Map.open(path, mmap=True)


def append(path: Path) -> object:
    return surefix.Map.append(path, surefix.Map.from_descriptors(MORE, metric="euclidean"))


def join(path: Path) -> object:
    return surefix.Map.join([surefix.Map.open(path), surefix.Map.open(path)])


def info(path: Path) -> object:
    surefix_("map", "info", path, code=None)
    raise AssertionError("it did not end")


def restored(path: Path) -> object:
    return surefix.Matcher.restore(path.read_bytes())


def localizer(path: Path) -> object:
    route = surefix.Map.from_descriptors(np.eye(4, dtype=np.float32), metric="euclidean")
    return surefix.Localizer.restore(route, path.read_bytes())


def statistics(path: Path) -> object:
    return Running.restore(path.read_bytes())


def command(*arguments: str) -> Any:
    """The command line, given the file for each ``{}``."""

    def run(path: Path) -> object:
        import sys

        from surefix import cli

        sys.argv = ["surefix", *(str(path) if each == "{}" else each for each in arguments)]
        return cli.main()

    return run


CONFIG = {
    "sequence_length": 2, "weight": 0.99, "tolerance": 1, "smoothing": 3, "gradient": "halved",
    "floor": "running", "speeds": [1.0], "motion": None, "technique_weights": [],
}  # fmt: skip
STATE = {
    "map": None, "frames": 0, "running": 0, "techniques": [], "lowest": None, "anchors": [], "track": None,
}  # fmt: skip


def snapshot(places: int, tensors: dict[str, Any] | None = None, **more: Any) -> Make:
    config = CONFIG | {name: more.pop(name) for name in list(more) if name in CONFIG}
    entry = STATE | {"places": places, "config": config} | more
    tensors = {"columns": ("F32", (0, places))} if tensors is None else tensors
    return archive(tensors, entry, format="surefix-snapshot")


SNAPSHOTS: dict[str, tuple[Make, str]] = {
    "of 200 million places": (snapshot(200_000_000), "ask for"),
    "of 2^62 places": (snapshot(1 << 62), "ask for"),
    "of a window of 10 million columns": (
        snapshot(10_000_000, sequence_length=10_000_000), "ask for"),
    "of a window of a million places": (snapshot(1_000_000, sequence_length=100), "ask for"),
    "of a tracker of many places": (
        snapshot(50_000_000, motion={"speeds": [1.0]}), "entry cannot be read|ask for"),
    "of 600,000 anchors": (snapshot(5, anchors=[(0, False)] * 600_000), "columns or anchors"),
    "of impossible frames": (snapshot(5, frames=1 << 61), "frames"),
    "of more columns than the window": (
        snapshot(5, {"columns": ("F32", (100_000, 5))}, frames=1 << 20), "columns or anchors"),
    "of 2^40 statistics": (snapshot(5, running=1 << 40), "statistics of the drive"),
    "of 2 million techniques": (snapshot(5, techniques=[0] * 1_000_000), "technique"),
    "of other segments": (
        snapshot(5, segments={"list": [], "links": []}), "entry|segments|another"),
    "of 140,000 tensors": (archive({}, header=many), "at most 1024 tensors"),
}  # fmt: skip
MEANS = {"mean": ("F64", (3,)), "square": ("F64", (4,))}
MAPS = [
    *(
        Row(f"map, {door}: {name}", open_, make, error, text)
        for door, open_ in (("open", surefix.Map.open), ("mapped", mapped), ("append", append))
        for name, (make, error, text) in FILES.items()
        if error or door == "open"
        if not (door != "open" and "thumbnails of 200" in name)
    ),
    *(Row(f"map, open: {name}", surefix.Map.open, *row) for name, row in LATE.items()),
    *(
        Row(f"map, {door}: {name}", open_, make, FILE, text)
        for door, open_ in (("open", surefix.Map.open), ("mapped", mapped), ("append", append))
        for name, (make, text) in NOT_FILES.items()
    ),
    *(
        Row(f"map, join: {name}", join, *FILES[name])
        for name in ("names of 200 GB", "140,000 empty tensors", "zeros of 200 GB")
    ),
    *(
        Row(f"map info: {name}", command("map", "info", "{}"), make, COMMAND, text)
        for name, (make, text) in NOT_FILES.items()
        if name != "a folder"
    ),
    *(
        Row(f"map info: {name}", command("map", "info", "{}"), FILES[name][0], COMMAND, FILES[name][2])
        for name in ("names of 200 GB", "140,000 empty tensors", "a header longer than the file")
    ),
    *(
        Row(f"snapshot, matcher: {name}", restored, make, VALUE, text)
        for name, (make, text) in SNAPSHOTS.items()
    ),
    Row("snapshot, localizer: of 200 million places", localizer, snapshot(200_000_000, map=1), VALUE, "another map"),
    Row("snapshot, localizer: of another map", localizer, snapshot(4, map=1), VALUE, "another map"),
    Row("statistics: that do not fit", statistics, archive(MEANS, {"count": 1}, format="surefix-running"), VALUE, "square: expected"),
    Row("statistics: of 2^63 vectors", statistics, archive({**MEANS, "square": ("F64", (3,))}, {"count": 1 << 63}, format="surefix-running"), VALUE, "no vectors have"),
    Row("statistics: 140,000 tensors", statistics, archive({}, header=many), VALUE, "at most 1024 tensors"),
]  # fmt: skip
