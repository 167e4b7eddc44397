"""Files that claim more than they hold: made by code, most of them sparse."""

from __future__ import annotations

import json
import math
import os
import socket
import struct
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

Make = Callable[[Path], Path]
# What a sparse file claims: more than any machine has.
HUGE = 200 * 10**9
RECORD = {"metric": "euclidean", "descriptor": {"kind": "ready"}}
BYTES = {"U8": 1, "I8": 1, "F16": 2, "F32": 4, "F64": 8, "U64": 8}


def archive(
    tensors: Mapping[str, tuple[str, Sequence[int]]],
    entry: Mapping[str, Any] | Callable[[], Mapping[str, Any]] | None = None,
    *,
    format: str = "surefix-map",
    header: Callable[[], str] | str | None = None,
    length: int | None = None,
    data: bytes = b"",
) -> Make:
    """A container: names with types and shapes, the entry, and zeros after it (``data`` first). A long
    header or entry is made when it is written.
    """

    def text_and_end() -> tuple[bytes, int]:
        named: dict[str, Any] = {}
        end = 0
        for name, (dtype, shape) in tensors.items():
            start, end = end, end + BYTES[dtype] * math.prod(shape)
            named[name] = {"dtype": dtype, "shape": list(shape), "data_offsets": [start, end]}
        rest = entry() if callable(entry) else RECORD if entry is None else entry
        stamp = json.dumps({"format": format, "version": 1, **rest})
        whole = json.dumps(named | {"__metadata__": {"surefix": stamp}})
        text = whole if header is None else header() if callable(header) else header
        return text.encode(), end

    def make(folder: Path) -> Path:
        path = folder / "route.safetensors"
        text, end = text_and_end()
        with path.open("wb") as file:
            file.write(struct.pack("<Q", len(text) if length is None else length))
            file.write(text)
            file.write(data)
            file.truncate(8 + len(text) + end)
        return path

    return make


def written(name: str, content: bytes | str) -> Make:
    """A file of these bytes."""

    def make(folder: Path) -> Path:
        path = folder / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return make


def sparse(name: str, start: bytes = b"", size: int = HUGE) -> Make:
    """A file that is long and takes no room: zeros after its start."""

    def make(folder: Path) -> Path:
        path = folder / name
        with path.open("wb") as file:
            file.write(start)
            file.truncate(size)
        return path

    return make


def pipe(name: str) -> Make:
    """A pipe whose other end stays closed."""

    def make(folder: Path) -> Path:
        os.mkfifo(folder / name)
        return folder / name

    return make


def device(name: str) -> Make:
    """A device that never ends."""

    def make(folder: Path) -> Path:
        (folder / name).symlink_to("/dev/zero")
        return folder / name

    return make


def bound_socket(name: str) -> Make:
    """A socket, which no file can be read from."""

    def make(folder: Path) -> Path:
        here = Path.cwd()
        # The name of a socket is short.
        os.chdir(folder)
        socket.socket(socket.AF_UNIX).bind(name)
        os.chdir(here)
        return folder / name

    return make


def subfolder(name: str) -> Make:
    """A folder with the name of a file."""

    def make(folder: Path) -> Path:
        (folder / name).mkdir()
        return folder / name

    return make


def npy(
    shape: tuple[int, ...], dtype: str = "<f4", data: int = 0, header: str | None = None
) -> bytes:
    """The header of an array, and some bytes of it."""
    text = header or f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}"
    padded = text.ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(padded)) + padded.encode() + bytes(data)


def zipped(name: str, member: bytes, claimed: int | None = None, method: int = 8) -> bytes:
    """A zip archive of one member; ``claimed`` is the size that it says it has."""
    packed = zlib.compressobj(9, zlib.DEFLATED, -15)
    body = packed.compress(member) + packed.flush() if method == 8 else member
    size = len(member) if claimed is None else claimed
    about = struct.pack(
        "<HHHHHIIIHH", 20, 0, method, 0, 33, zlib.crc32(member), len(body), size, len(name), 0
    )
    local = b"PK\x03\x04" + about + name.encode() + body
    central = b"PK\x01\x02\x14\x00" + about + struct.pack("<HHHII", 0, 0, 0, 0, 0) + name.encode()
    end = b"PK\x05\x06" + struct.pack("<HHHHIIH", 0, 0, 1, 1, len(central), len(local), 0)
    return local + central + end


def png(
    width: int,
    height: int,
    *,
    depth: int = 8,
    colour: int = 0,
    data: bytes = b"",
    extra: bytes = b"",
) -> bytes:
    """A picture of this size that has the packed ``data``."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        return (
            struct.pack(">I", len(content))
            + kind
            + content
            + struct.pack(">I", zlib.crc32(kind + content))
        )

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + extra + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def zeros_packed(count: int) -> bytes:
    """That many zeros, packed by DEFLATE."""
    packer = zlib.compressobj(9)
    piece = bytes(1 << 20)
    parts = [
        packer.compress(piece[: min(len(piece), count - at)]) for at in range(0, count, 1 << 20)
    ]
    return b"".join([*parts, packer.flush()])


def tiff(tags: Sequence[tuple[int, int, int, int]]) -> bytes:
    """A picture of these tags: number, type, count, value."""
    entries = b"".join(struct.pack("<HHII", *tag) for tag in tags)
    return b"II*\x00" + struct.pack("<IH", 8, len(tags)) + entries + struct.pack("<I", 0)


def bmp(width: int, height: int) -> bytes:
    """A picture without pixels."""
    return struct.pack(
        "<2sIHHIIiiHHIIiiII", b"BM", 54, 0, 0, 54, 40, width, height, 1, 24, 0, 0, 0, 0, 0, 0
    )


def tagged(opcode: int, content: bytes, length: int | None = None) -> bytes:
    """A record of an MCAP file."""
    return bytes([opcode]) + struct.pack("<Q", len(content) if length is None else length) + content
