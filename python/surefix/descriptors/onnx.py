"""Any network that an ONNX file holds, run by onnxruntime."""

import hashlib
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from surefix._extra import require
from surefix.descriptors.descriptor import check_one_each, checked_batch, checked_rows, in_batches
from surefix.descriptors.network_input import IMAGENET_MEAN, IMAGENET_STD, NetworkInput
from surefix.errors import SurefixValueError, mismatch, refusal
from surefix.frames.pixels import check_pixels
from surefix.tables.regular import check_regular

NUMBERS: dict[str, Any] = {"tensor(float)": np.float32, "tensor(float16)": np.float16}
# Calls a service in the cloud: never wanted here.
REMOTE = "AzureExecutionProvider"


class Onnx:
    """A network from an ONNX file as a descriptor: RGB images in; one of its outputs, flattened, is
    the vector.

    Needs ``pip install "surefix[learned]"``.

    Parameters
    ----------
    path : str or path
        The model: one input (n, 3, H, W), float32 or float16.
    output : str, optional
        The output to take, if there are several.
    size : (int, int), optional
        Width and height that images are resized to (Pillow's antialiased bilinear); by default the
        model's own, and if it takes any size, the images as they are.
    mean, std : three floats, optional
        Of RGB / 255, which the network was trained with: ImageNet's by default; None for both
        leaves 0 to 1.
    batch : int
        Images a run. A model that is fixed to a number of images gets that number, filled up at
        the end.
    providers : list of str, optional
        The providers of onnxruntime, such as ``["CUDAExecutionProvider", "CPUExecutionProvider"]``;
        by default all that the installed onnxruntime offers, in its order.
    threads : int, optional
        Threads of one operation; onnxruntime's choice by default.

    Raises
    ------
    SurefixFileError
        If the file cannot be read.
    SurefixValueError
        If it is no ONNX model, has no such output, or takes other images than these.
    SurefixError
        If onnxruntime is missing.

    Notes
    -----
    ``recipe`` has the file's name and SHA-256. Weights in a second file beside the model are not in
    the sum.

    Examples
    --------
    >>> from surefix.descriptors import Onnx
    >>> network = Onnx("efficientnet.onnx", output="feat_s16", size=(256, 128))   # doctest: +SKIP
    >>> network.describe(surefix.read_image("photo.jpg")).shape   # doctest: +SKIP
    (1, 14336)
    """

    def __init__(
        self,
        path: str | PathLike[str],
        output: str | None = None,
        size: tuple[int, int] | None = None,
        mean: Sequence[float] | None = IMAGENET_MEAN,
        std: Sequence[float] | None = IMAGENET_STD,
        batch: int = 8,
        providers: Sequence[str] | None = None,
        threads: int | None = None,
    ) -> None:
        self.path = Path(path)
        self._made_with = (path, output, size, mean, std, batch, providers, threads)
        batch = checked_batch(batch)
        self._sha256 = file_sha256(self.path)
        self._session = open_session(self.path, providers, threads)
        node = self._only_input()
        self._input_name: str = node.name
        if node.type not in NUMBERS:
            raise mismatch(self.path, "an input of float32 or float16", node.type)
        self._number = NUMBERS[node.type]
        fixed_batch, fixed_size = self._fixed(node)
        if fixed_size is not None:
            check_pixels(*fixed_size, f"{self.path}, images")
        wanted = NetworkInput(size, mean, std)
        if fixed_size is not None and wanted.size not in (None, fixed_size):
            fixed = f"which the model is fixed to (its input is {_shape(node)})"
            raise mismatch(self.path, f"the size {fixed_size}, {fixed}", wanted.size)
        self._input = NetworkInput(wanted.size or fixed_size, mean, std)
        self.output = self._chosen(output)
        self.batch = batch if fixed_batch is None else fixed_batch
        self._fill = fixed_batch is not None

    @property
    def name(self) -> str:
        """``onnx:``, the file's name without its ending, and the output."""
        return f"onnx:{self.path.stem}/{self.output}"

    @property
    def size(self) -> tuple[int, int] | None:
        """Width and height that images are resized to; None if they stay as they are."""
        return self._input.size

    @property
    def recipe(self) -> Mapping[str, object]:
        """The model's file and its SHA-256, the output, and the preparation of images."""
        return {
            "name": self.name,
            "kind": "onnx",
            "file": self.path.name,
            "sha256": self._sha256,
            "output": self.output,
            **self._input.recipe,
        }

    def describe(
        self, images: Sequence[npt.NDArray[np.uint8]] | npt.NDArray[np.uint8]
    ) -> npt.NDArray[np.float32]:
        """The vectors of some images, (n, dim); of one image, given as an array, (1, dim).

        Raises
        ------
        SurefixValueError
            If an image is not uint8 (H, W) or (H, W, 3), or the output is not a finite vector an
            image.
        """
        return in_batches(images, self.batch, self._run)

    def __repr__(self) -> str:
        return f"Onnx({str(self.path)!r}, output={self.output!r}, size={self.size})"

    def __reduce__(self) -> tuple[Any, ...]:
        # A session of the runtime cannot be pickled: the model is opened again.
        return Onnx, self._made_with

    def _run(self, images: list[npt.NDArray[np.uint8]], start: int) -> npt.NDArray[np.float32]:
        count = len(images)
        if self._fill:
            images = images + [images[-1]] * (self.batch - count)
        planes = self._input.batch(images).astype(self._number, copy=False)
        try:
            (output,) = self._session.run([self.output], {self._input_name: planes})
        except Exception as error:
            # The errors of onnxruntime have no common base.
            height, width = planes.shape[2:]
            of = f"{len(images)} images of {width} x {height}"
            refused = f"{self.path}: the model does not run on {of}: {short(error)}"
            raise SurefixValueError(refused) from None
        what = f"{self.path}, output {self.output}"
        if not isinstance(output, np.ndarray):
            expected = f"a vector an image, ({len(images)}, ...) for {len(images)} images"
            raise mismatch(what, expected, type(output).__name__)
        check_one_each(output.shape, len(images), what)
        rows = output.reshape(len(images), -1)[:count]
        names = [f"image {start + index} of the call" for index in range(count)]
        return checked_rows(rows, count, what, names)

    def _only_input(self) -> Any:
        inputs = self._session.get_inputs()
        if len(inputs) != 1:
            named = ", ".join(f"{node.name} {_shape(node)}" for node in inputs) or "none"
            raise mismatch(self.path, "a model with one input, images", named)
        return inputs[0]

    def _fixed(self, node: Any) -> tuple[int | None, tuple[int, int] | None]:
        """The number and the size of images that the model is fixed to."""
        shape = node.shape
        if len(shape) != 4 or (isinstance(shape[1], int) and shape[1] != 3):
            expected = "an input of RGB images, (n, 3, H, W)"
            raise mismatch(self.path, expected, f"{node.name} {_shape(node)}")
        sides = (side if isinstance(side, int) and side > 0 else None for side in shape)
        count, _, height, width = sides
        if (height is None) != (width is None):
            raise mismatch(self.path, "both sides of the input free or fixed", _shape(node))
        return count, None if height is None or width is None else (width, height)

    def _chosen(self, output: str | None) -> str:
        nodes = self._session.get_outputs()
        listed = ", ".join(f"{node.name} {_shape(node)}" for node in nodes)
        if output is None and len(nodes) == 1:
            return str(nodes[0].name)
        if output is None:
            several = f"expected output=NAME, as the model has several: {listed}"
            raise SurefixValueError(f"{self.path}: {several}")
        if output not in [node.name for node in nodes]:
            raise mismatch(self.path, f"one of the outputs {listed}", repr(output))
        return output


def open_session(path: Path, providers: Sequence[str] | None, threads: int | None) -> Any:
    runtime = require("onnxruntime", "an ONNX model", "onnxruntime", "surefix[learned]")
    offered = [provider for provider in runtime.get_available_providers() if provider != REMOTE]
    unknown = [provider for provider in providers or () if provider not in offered]
    if unknown:
        raise mismatch("providers", f"some of {', '.join(offered)}", ", ".join(unknown))
    options = runtime.SessionOptions()
    # Failures come as errors; the runtime would also write them to stderr.
    options.log_severity_level = 4
    if threads is not None:
        options.intra_op_num_threads = threads
    try:
        return runtime.InferenceSession(str(path), options, providers=list(providers or offered))
    except Exception as error:
        none = f"not an ONNX model that onnxruntime {runtime.__version__} can load"
        raise SurefixValueError(f"{path}: {none}: {short(error)}") from None


def file_sha256(path: Path) -> str:
    check_regular(path, "cannot read the model")
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise refusal(path, "cannot read the model", error) from None


def _shape(node: Any) -> str:
    return "(" + ", ".join("?" if side is None else str(side) for side in node.shape) + ")"


def short(error: Exception) -> str:
    """The message of onnxruntime, without its code and the path."""
    return " ".join(str(error).split("\n")[0].split(" : ")[-1].split())
