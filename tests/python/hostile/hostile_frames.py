"""Hostile images, videos, bags and networks."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from hostile_files import (
    Make,
    bmp,
    bound_socket,
    device,
    pipe,
    png,
    sparse,
    subfolder,
    tagged,
    tiff,
    written,
    zeros_packed,
)
from hostile_maps import command
from hostile_row import ANY, COMMAND, FILE, VALUE, Row

import surefix
from surefix._core import decode_image
from surefix.descriptors import Onnx
from surefix.frames import Odometry
from surefix.frames import open as open_frames


def bomb_png(width: int, height: int, depth: int, colour: int, name: str = "a.png") -> Make:
    """All zeros, packed."""
    samples = {0: 1, 2: 3, 4: 2, 6: 4}[colour]
    size = height * (1 + (width * depth * samples + 7) // 8)

    def make(folder: Path) -> Path:
        (folder / name).write_bytes(
            png(width, height, depth=depth, colour=colour, data=zeros_packed(size))
        )
        return folder / name

    return make


def chunk_bomb(kind: bytes, before: bytes) -> bytes:
    content = before + zeros_packed(3 * 10**8)
    return (
        struct.pack(">I", len(content))
        + kind
        + content
        + struct.pack(">I", zlib.crc32(kind + content))
    )


def profile_png(kind: bytes, before: bytes) -> Make:
    """A picture of one pixel with 300 MB of metadata, packed."""

    def make(folder: Path) -> Path:
        content = png(1, 1, data=zlib.compress(b"\0\0"), extra=chunk_bomb(kind, before))
        (folder / "a.png").write_bytes(content)
        return folder / "a.png"

    return make


STRIPS = [(256, 4, 1, 100_000), (257, 4, 1, 100_000), (258, 3, 1, 8), (259, 3, 1, 1), (262, 3, 1, 1), (273, 4, 1, 8), (277, 3, 1, 1), (278, 4, 1, 100_000), (279, 4, 1, 10)]  # fmt: skip
JPEG = b"\xff\xd8\xff\xc0\x00\x11\x08\xff\xff\xff\xff\x03\x01\x22\x00\x02\x11\x01\x03\x11\x01\xff\xda\x00\x0c\x03\x01\x00\x02\x11\x03\x11\x00\x3f\x00\xff\xd9"
WEBP = b"RIFF\x1e\x00\x00\x00WEBPVP8L\x11\x00\x00\x00\x2f\xff\xff\xff\x0f" + bytes(12)
IMAGES: dict[str, tuple[Make, str, str]] = {
    "png of 65,000 x 65,000": (written("a.png", png(65_000, 65_000)), VALUE, "max_pixels = 100000000"),
    "png of 2^31 x 2^31": (written("a.png", png(2**31 - 1, 2**31 - 1)), VALUE, "image .*a.png"),
    "png of 22,000 x 22,000 of 1 bit": (written("a.png", png(22_000, 22_000, depth=1)), VALUE, "max_pixels"),
    "png of 11,500 x 11,500 with alpha": (written("a.png", png(11_500, 11_500, colour=6)), VALUE, "max_pixels"),
    "png of 8,000 x 8,000 of 16 bits": (written("a.png", png(8_000, 8_000, depth=16, colour=6)), VALUE, "max_pixels"),
    "png of 9,999 x 9,999 that memory does not hold": (bomb_png(9_999, 9_999, 8, 2), VALUE, "memory"),
    "png with a profile of 300 MB": (profile_png(b"iCCP", b"a\0\0"), "", ""),
    "png with a text of 300 MB": (profile_png(b"zTXt", b"a\0\0"), "", ""),
    "jpeg of 65,535 x 65,535": (written("a.jpg", JPEG), VALUE, "max_pixels|image .*a.jpg"),
    "bmp of 60,000 x 60,000": (written("a.bmp", bmp(60_000, 60_000)), VALUE, "max_pixels"),
    "tiff of 100,000 x 100,000": (written("a.tif", tiff(STRIPS)), VALUE, "max_pixels"),
    "tiff with a tag of 2^32 values": (written("a.tif", tiff([*STRIPS, (320, 3, 2**32 - 1, 8)])), VALUE, "image .*a.tif"),
    "webp of 16,384 x 16,384": (written("a.webp", WEBP), VALUE, "max_pixels|image .*a.webp"),
    "pgm of 10^9 x 10^9": (written("a.pgm", b"P5 1000000000 1000000000 255\n"), VALUE, "image .*a.pgm"),
    "pgm with a width of 6 MB": (written("a.pgm", b"P5 " + b"1" * 6_000_000), VALUE, "image .*a.pgm"),
    "ppm of 60,000 x 60,000 in words": (written("a.ppm", b"P3 60000 60000 255\n0 0 0"), VALUE, "max_pixels"),
    "a file of 200 GB": (sparse("a.png", png(10, 10)), FILE, "at most"),
    "an empty file": (written("a.png", b""), VALUE, "empty"),
    "a pipe": (pipe("a.png"), FILE, "expected a file, got a pipe"),
    "a device": (device("a.png"), FILE, "expected a file, got a device"),
    "a socket": (bound_socket("a.png"), FILE, "expected a file, got a socket"),
    "a folder": (subfolder("a.png"), FILE, "[Ii]s a directory"),
}  # fmt: skip


def decoded(path: Path) -> object:
    return decode_image(path.read_bytes())


def listed(path: Path) -> object:
    return surefix.Map.from_images([path, path])


def foreign(ending: str) -> Make:
    """AVIF or HEIC of 12,000 x 9,000, all grey."""

    def make(folder: Path) -> Path:
        from PIL import Image

        from surefix.frames.foreign import endings

        assert ending in endings()
        Image.new("L", (2_000, 1_500)).save(folder / f"a.{ending}", quality=1)
        surefix.set_max_pixels(2_999_999)
        return folder / f"a.{ending}"

    return make


def all_frames(path: Path) -> object:
    return [frame.image.shape for frame in open_frames(path)]


def wide_video(folder: Path) -> Path:
    """An AVI that claims frames of 60,000 x 60,000."""
    from recordings import pictures, write_video

    path = write_video(folder / "a.avi", pictures(2), codec="ffv1")
    content = path.read_bytes()
    old, new = struct.pack("<ii", 64, 48), struct.pack("<ii", 60_000, 60_000)
    assert old in content
    path.write_bytes(content.replace(old, new))
    return path


MAGIC = b"\x89MCAP0\r\n"
HEAD = tagged(1, struct.pack("<I", 4) + b"ros2" + struct.pack("<I", 0))


def mcap_chunk(compression: bytes, data: bytes, size: int) -> bytes:
    body = struct.pack("<QQQI", 0, 0, size, 0) + struct.pack("<I", len(compression)) + compression
    return tagged(6, body + struct.pack("<Q", len(data)) + data)


def zstd_bomb(folder: Path) -> Path:
    import zstandard

    data = zstandard.ZstdCompressor(level=3).compress(bytes(10**9 // 2))
    (folder / "a.mcap").write_bytes(MAGIC + HEAD + mcap_chunk(b"zstd", data, 10**9 // 2) + MAGIC)
    return folder / "a.mcap"


def lz4_bomb(folder: Path) -> Path:
    import lz4.frame

    data = lz4.frame.compress(bytes(10**9 // 2))
    (folder / "a.mcap").write_bytes(MAGIC + HEAD + mcap_chunk(b"lz4", data, 10**9 // 2) + MAGIC)
    return folder / "a.mcap"


def folder_bag(folder: Path) -> Path:
    (folder / "bag").mkdir()
    (folder / "bag" / "metadata.yaml").write_text("rosbag2_bagfile_information: {}")
    pipe("a.db3")(folder / "bag")
    return folder / "bag"


ROS1 = b"#ROSBAG V2.0\n"


def record1(fields: dict[bytes, bytes], data: bytes = b"", claimed: int | None = None) -> bytes:
    """A record of a bag of ROS 1."""
    head = b"".join(
        struct.pack("<I", len(k) + 1 + len(v)) + k + b"=" + v for k, v in fields.items()
    )
    size = len(data) if claimed is None else claimed
    return struct.pack("<I", len(head)) + head + struct.pack("<I", size) + data


BAG_HEAD = record1({b"op": b"\x03", b"index_pos": struct.pack("<Q", 1 << 60), b"conn_count": struct.pack("<I", 2**32 - 1), b"chunk_count": struct.pack("<I", 2**32 - 1)}, bytes(100))  # fmt: skip


def image_bag(data: bytes, **how: Any) -> Make:
    """A bag with one image that is not what it says."""

    def make(folder: Path) -> Path:
        from recordings import Bag

        with Bag(folder, "ros1") as bag:
            if how:
                bag.image("/camera", np.frombuffer(data, np.uint8), 1.0, **how)
            else:
                bag.compressed("/camera", data, "png", 1.0)
        return folder / "drive.bag"

    return make


def described(path: Path) -> object:
    return Onnx(path).describe(np.zeros((8, 8, 3), np.uint8))


def network(**how: Any) -> Make:
    """A network whose only weights are ``how`` says, in ONNX's protobuf."""

    def make(folder: Path) -> Path:
        import onnx
        from onnx import TensorProto, helper

        shape = how.get("shape", (1, 3, 8, 8))
        x = helper.make_tensor_value_info("x", TensorProto.FLOAT, shape)
        y = helper.make_tensor_value_info("y", TensorProto.FLOAT, None)
        nodes = [helper.make_node("Flatten", ["x"], ["y"])]
        weights = []
        if "zeros" in how:
            weights.append(helper.make_tensor("n", TensorProto.INT64, [1], [how["zeros"]]))
            nodes = [helper.make_node("ConstantOfShape", ["n"], ["z"]), helper.make_node("ReduceSum", ["z"], ["s"]), helper.make_node("Add", ["x", "s"], ["y"])]  # fmt: skip
        graph = helper.make_graph(nodes, "g", [x], [y], weights)
        if "claims" in how:
            tensor = graph.initializer.add()
            tensor.name, tensor.data_type = "w", TensorProto.FLOAT
            tensor.dims.extend([how["claims"]])
            tensor.raw_data = b"1234"
            graph.node.add().CopyFrom(helper.make_node("Add", ["x", "w"], ["v"]))
            graph.output.add().CopyFrom(helper.make_tensor_value_info("v", TensorProto.FLOAT, None))
        onnx.save(
            helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8),
            folder / "a.onnx",
        )
        return folder / "a.onnx"

    return make


AV, BAGS, ONNX, PIL = (
    ("av",),
    ("rosbags", "mcap", "zstandard", "lz4"),
    ("onnxruntime", "onnx"),
    ("PIL",),
)
FRAMES = [
    *(Row(f"image, read: {name}", surefix.read_image, *row) for name, row in IMAGES.items()),
    *(
        Row(f"image, decode: {name}", decoded, row[0], VALUE, row[2].replace("a.", "image|").replace(".*", ""))
        for name, row in IMAGES.items()
        if row[1] == VALUE and name in ("png of 65,000 x 65,000", "bmp of 60,000 x 60,000", "tiff of 100,000 x 100,000")
    ),
    *(
        Row(f"image, map of a list: {name}", listed, *IMAGES[name])
        for name in ("png of 65,000 x 65,000", "a pipe", "a device", "png of 11,500 x 11,500 with alpha")
    ),
    Row("image, avif: larger than the limit", surefix.read_image, foreign("avif"), VALUE, "max_pixels", PIL),
    Row("image, avif: a pipe", surefix.read_image, pipe("a.avif"), FILE, "got a pipe", PIL),
    Row("image, frames: a pipe", all_frames, pipe("a.png"), ANY, "pipe|folder"),
    Row("image, map build: a pipe", command("map", "build", "{}", "-o", "o"), pipe("a.png"), COMMAND, "pipe|folder|expected"),
    Row("image, run: 65,000 x 65,000", command("run", "{}", "{}"), IMAGES["png of 65,000 x 65,000"][0], COMMAND, "got the image"),
    Row("video: frames of 60,000 x 60,000", all_frames, wide_video, VALUE, "max_pixels|damaged|a video", AV),
    Row("video: zeros of 200 GB", all_frames, sparse("a.mp4"), VALUE, "a video", AV),
    Row("video: a box longer than the file", all_frames, written("a.mp4", b"\0\0\0\x01ftyp" + b"\x7f" * 16), VALUE, "a video", AV),
    Row("video: a list of other files", all_frames, written("a.mp4", "#EXTM3U\n#EXTINF:1,\n/dev/zero\n"), VALUE, "a video", AV),
    Row("video: a pipe", all_frames, pipe("a.mp4"), FILE, "got a pipe", AV),
    Row("video: a device", all_frames, device("a.mkv"), FILE, "got a device", AV),
    Row("bag, mcap: a record of 2^60 bytes", all_frames, written("a.mcap", MAGIC + HEAD + tagged(6, b"", 1 << 60)), VALUE, "a bag", BAGS),
    Row("bag, mcap: a record of 1 GB", all_frames, written("a.mcap", MAGIC + HEAD + tagged(5, b"1234", 10**9)), VALUE, "a bag", BAGS),
    Row("bag, mcap: a chunk of 500 MB in 50 kB (zstd)", all_frames, zstd_bomb, VALUE, "a bag", BAGS),
    Row("bag, mcap: a chunk of 500 MB in 2 MB (lz4)", all_frames, lz4_bomb, VALUE, "a bag", BAGS),
    Row("bag, mcap: zeros of 200 GB", all_frames, sparse("a.mcap", MAGIC), VALUE, "a bag", BAGS),
    Row("bag, mcap: a pipe", all_frames, pipe("a.mcap"), FILE, "got a pipe", BAGS),
    Row("bag, db3: zeros of 200 GB", all_frames, sparse("a.db3"), VALUE, "a bag", BAGS),
    Row("bag, db3: a pipe", all_frames, pipe("a.db3"), FILE, "got a pipe", BAGS),
    Row("bag, folder: a pipe in it", all_frames, folder_bag, FILE, "got a pipe", BAGS),
    Row("bag, ros1: 2^32 chunks", all_frames, written("a.bag", ROS1 + BAG_HEAD), VALUE, "a bag", BAGS),
    Row("bag, ros1: a header of 4 GB", all_frames, written("a.bag", ROS1 + struct.pack("<I", 2**32 - 1)), VALUE, "a bag", BAGS),
    Row("bag, ros1: zeros of 200 GB", all_frames, sparse("a.bag", ROS1), VALUE, "a bag", BAGS),
    Row("bag, ros1: a pipe", all_frames, pipe("a.bag"), FILE, "got a pipe", BAGS),
    Row("bag, ros1: a device", all_frames, device("a.bag"), FILE, "got a device", BAGS),
    Row("bag, image of 4 billion rows", all_frames, image_bag(bytes(64), size=(2**32 - 1, 2**31), step=2**32 - 1), VALUE, "expected", BAGS),
    Row("bag, png of 65,000 x 65,000", all_frames, image_bag(png(65_000, 65_000)), VALUE, "max_pixels", BAGS),
    Row("odometry, bag: a pipe", Odometry.from_bag, pipe("a.bag"), FILE, "got a pipe", BAGS),
    Row("run: a bag that is a pipe", command("run", "{}", "{}"), pipe("a.bag"), COMMAND, "got a pipe", BAGS),
    Row("onnx: weights that are not there", Onnx, network(claims=10**12), VALUE, "not an ONNX model", ONNX),
    Row("onnx: 10^12 zeros", described, network(zeros=10**12), VALUE, "ONNX model|memory", ONNX),
    Row("onnx: images of 10^6 x 10^6", Onnx, network(shape=(1, 3, 10**6, 10**6)), VALUE, "max_pixels", ONNX),
    Row("onnx: zeros of 200 MB", Onnx, sparse("a.onnx", size=2 * 10**8), VALUE, "not an ONNX model", ONNX),
    Row("onnx: a pipe", Onnx, pipe("a.onnx"), FILE, "got a pipe", ONNX),
    Row("onnx: a device", Onnx, device("a.onnx"), FILE, "got a device", ONNX),
]  # fmt: skip
