"""Hostile arrays: NumPy, HDF5, safetensors and faiss files."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

from hostile_files import (
    HUGE,
    Make,
    device,
    npy,
    pipe,
    sparse,
    subfolder,
    written,
    zeros_packed,
    zipped,
)
from hostile_maps import command
from hostile_row import ANY, COMMAND, FILE, VALUE, Row

from surefix.descriptors import load
from surefix.frames import open as open_frames
from surefix.tables.columns import MatrixColumns
from surefix.tables.matrices import read_matrix
from surefix.tables.npy import read_npy
from surefix.tables.truth import read_truth


def whole(path: Path) -> object:
    return read_npy(path, "the truth")


def truth(path: Path) -> object:
    return read_truth(path, 10, 10)


CLAIMS = npy((10**12,))
PICTURES = npy((10**6, 10**4, 10**4), "|u1")
NPY: dict[str, tuple[Make, str, str]] = {
    "10^12 numbers in 128 bytes": (written("a.npy", CLAIMS), VALUE, "not a .npy array, or a truncated one"),
    "a shape that overflows": (written("a.npy", npy((2**40, 2**40))), VALUE, "truncated one"),
    "a side below 0": (written("a.npy", npy((-1, 4))), VALUE, "not a .npy array"),
    "a header of lists": (written("a.npy", npy((), header="[" * 90)), VALUE, "not a .npy array"),
    "a header without an end": (written("a.npy", b"\x93NUMPY\x02\x00\xff\xff\xff\xff{"), VALUE, "not a .npy array"),
    "objects": (written("a.npy", npy((2, 2), "|O", 8)), VALUE, "objects|pickle|damaged"),
    "an empty file": (written("a.npy", b""), VALUE, "not a .npy array"),
    "a zip": (written("a.npy", zipped("a.npy", CLAIMS)), VALUE, "an archive of several"),
    "a pipe": (pipe("a.npy"), FILE, "expected a file, got a pipe"),
    "a device": (device("a.npy"), FILE, "expected a file, got a device"),
    "a folder": (subfolder("a.npy"), FILE, "expected a file, got a folder"),
}  # fmt: skip
REAL = sparse("a.npy", npy((HUGE // 8, 2)), HUGE + 128)
NPZ: dict[str, tuple[Make, str, str]] = {
    "a member that claims 200 GB": (
        written("a.npz", zipped("arr_0.npy", npy((HUGE // 8, 2)), 4 * 10**9)), VALUE, "claim to be"),
    "a beginning without an end": (written("a.npz", b"PK\x03\x04bomb"), VALUE, "not a .npz archive"),
    "a member cut short": (
        written("a.npz", zipped("arr_0.npy", npy((10**5, 2)) + bytes(1000))), VALUE, "truncated one|not an array"),
    "a member packed in another way": (
        written("a.npz", zipped("arr_0.npy", npy((2, 2), data=16), method=12)), VALUE, "packing"),
    "an empty file": (written("a.npz", b""), VALUE, "not a .npz archive"),
    "a pipe": (pipe("a.npz"), FILE, "expected a file, got a pipe"),
    "a device": (device("a.npz"), FILE, "expected a file, got a device"),
}  # fmt: skip


def bomb(folder: Path) -> Path:
    """A real one: 300 MB of zeros in 300 kB."""
    import zipfile

    with (
        zipfile.ZipFile(folder / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("arr_0.npy", "w") as member,
    ):
        member.write(npy((75_000_000, 4), "|u1"))
        for _ in range(300):
            member.write(bytes(10**6))
    return folder / "a.npz"


def hdf5(**how: Any) -> Make:
    """A data set of this shape of which nothing is stored."""

    def make(folder: Path) -> Path:
        import h5py

        with h5py.File(folder / "a.h5", "w") as file:
            file.create_dataset("rows", dtype="f4", **how)
        return folder / "a.h5"

    return make


def packed_hdf5(folder: Path) -> Path:
    """300 MB of zeros, packed."""
    import h5py

    with h5py.File(folder / "a.h5", "w") as file:
        rows = file.create_dataset("rows", (75_000, 1024), "f4", compression=4, chunks=(1000, 1024))
        packed = zeros_packed(4 * 1024 * 1000)
        for start in range(0, 75_000, 1000):
            rows.id.write_direct_chunk((start, 0), packed)
    return folder / "a.h5"


def damaged_hdf5(folder: Path) -> Path:
    path = hdf5(shape=(4, 4), data=[[1.0] * 4] * 4)(folder)
    content = bytearray(path.read_bytes())
    content[96:200] = b"\xff" * 104
    path.write_bytes(content)
    return path


def flat(dim: int, count: int, mark: bytes = b"IxF2", numbers: int = 0) -> bytes:
    about = struct.pack("<iqqqBi", dim, count, 1 << 20, 1 << 20, 1, 1)
    return mark + about + struct.pack("<Q", dim * count & (1 << 64) - 1) + bytes(4 * numbers)


H5, FAISS, SAFE = ("h5py",), ("faiss",), ("safetensors",)
ARRAYS = [
    *(Row(f"npy, truth: {name}", whole, *row) for name, row in NPY.items()),
    *(Row(f"npy, descriptors: {name}", load, *row) for name, row in NPY.items()),
    *(Row(f"npy, frames: {name}", open_frames, *row) for name, row in NPY.items() if name != "a folder"),
    *(
        Row(f"npy, columns: {name}", MatrixColumns, *NPY[name])
        for name in ("a header without an end", "a pipe", "a device", "an empty file")
    ),
    Row("npy, columns: 10^12 numbers", MatrixColumns, written("a.npy", npy((10**6, 10**6))), VALUE, "a whole .npy"),
    Row("npy, truth: 200 GB that are there", whole, REAL, ANY, "memory|needs"),
    Row("npy, matrix: 200 GB that are there", read_matrix, REAL, ANY, "memory|needs"),
    Row("npy, map build: 200 GB that are there", command("map", "build", "{}", "-o", "out.safetensors"), REAL, COMMAND, "memory|needs"),
    Row("npy, pictures that are not there", open_frames, written("a.npy", PICTURES), VALUE, "truncated one"),
    Row("npy, map build: 10^12 numbers", command("map", "build", "{}", "-o", "out.safetensors"), NPY["10^12 numbers in 128 bytes"][0], COMMAND, "truncated one"),
    Row("npy, run: a pipe", command("run", "{}", "{}"), NPY["a pipe"][0], COMMAND, "got a pipe"),
    *(Row(f"npz, descriptors: {name}", load, *row) for name, row in NPZ.items()),
    *(Row(f"npz, truth: {name}", truth, *row) for name, row in NPZ.items()),
    Row("npz, descriptors: a bomb of 300 MB", load, bomb, ANY, "memory|needs"),
    Row("hdf5: 10^13 numbers of which none is stored", load, hdf5(shape=(10**9, 10**4), chunks=(1, 10**4)), VALUE, "bytes of numbers", H5),
    Row("hdf5: 200 GB of which none is stored", load, hdf5(shape=(HUGE // 4096, 1024)), VALUE, "bytes of numbers", H5),
    Row("hdf5: a bomb of 300 MB", load, packed_hdf5, ANY, "memory|needs", H5),
    Row("hdf5: numbers in a device", load, hdf5(shape=(10, 10), external=[("/dev/zero", 0, 400)]), VALUE, "in another file", H5),
    Row("hdf5: damaged", load, damaged_hdf5, VALUE, "not an HDF5 file", H5),
    Row("hdf5: zeros of 200 GB", load, sparse("a.h5"), VALUE, "not an HDF5 file", H5),
    Row("hdf5: a pipe", load, pipe("a.h5"), FILE, "got a pipe", H5),
    Row("hdf5: a device", load, device("a.h5"), FILE, "got a device", H5),
    Row("faiss: 10^12 vectors", load, written("a.faiss", flat(128, 10**12)), VALUE, "as a faiss index says", FAISS),
    Row("faiss: vectors below 0", load, written("a.faiss", flat(-4, 10)), VALUE, "as a faiss index says", FAISS),
    Row("faiss: vectors that are not there", load, written("a.faiss", flat(4, 4, numbers=3)), VALUE, "faiss index", FAISS),
    Row("faiss: 200 GB that are there", load, sparse("a.faiss", flat(1000, HUGE // 8000)), ANY, "memory|needs|not a faiss", FAISS),
    Row("faiss: another index", load, written("a.faiss", flat(4, 10**12, b"IwFl")), VALUE, "got IndexIVFFlat", FAISS),
    Row("faiss: zeros of 200 GB", load, sparse("a.faiss"), VALUE, "not a faiss index", FAISS),
    Row("faiss: a pipe", load, pipe("a.faiss"), FILE, "got a pipe", FAISS),
    Row("safetensors: a header beyond the file", load, written("a.safetensors", struct.pack("<Q", 1 << 60)), VALUE, "not a .safetensors", SAFE),
    Row("safetensors: 200 GB that are there", load, sparse("a.safetensors", (lambda h: struct.pack("<Q", len(h)) + h)(b'{"a":{"dtype":"F32","shape":[25000000000,2],"data_offsets":[0,200000000000]}}'), 8 + 77 + HUGE), ANY, "memory|not a .safetensors|needs", SAFE),
    Row("safetensors: a pipe", load, pipe("a.safetensors"), FILE, "got a pipe", SAFE),
]  # fmt: skip
