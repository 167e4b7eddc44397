"""Small networks as ONNX files, and the same computations in NumPy."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import onnx
from onnx import TensorProto, helper, numpy_helper

MEAN, STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
RNG = np.random.default_rng(11)
# A convolution of stride 2, and the mean of each of its channels: enough to notice any swap of axes.
KERNEL = RNG.standard_normal((5, 3, 3, 3)).astype(np.float32)
BIAS = RNG.standard_normal(5).astype(np.float32)


def save(
    path: Path,
    shape: list[Any] | None = None,
    nodes: list[Any] | None = None,
    outputs: tuple[str, ...] = ("map", "mean"),
    number: int = TensorProto.FLOAT,
    more_inputs: tuple[str, ...] = (),
    output_number: int | None = None,
) -> Path:
    """The network with the outputs ``map`` (n, 5, H/2, W/2) and ``mean`` (n, 5, 1, 1), or one of
    other nodes.
    """
    dtype = np.float16 if number == TensorProto.FLOAT16 else np.float32
    first = [
        helper.make_node(
            "Conv", ["image", "kernel", "bias"], ["conv"], strides=[2, 2], pads=[1, 1, 1, 1]
        ),
        helper.make_node("Relu", ["conv"], ["map"]),
        helper.make_node("GlobalAveragePool", ["map"], ["mean"]),
    ]
    graph = helper.make_graph(
        first if nodes is None else nodes,
        "tiny",
        [
            helper.make_tensor_value_info(name, number, shape or ["n", 3, "height", "width"])
            for name in ("image", *more_inputs)
        ],
        [helper.make_tensor_value_info(name, output_number or number, None) for name in outputs],
        []
        if nodes
        else [
            numpy_helper.from_array(KERNEL.astype(dtype), "kernel"),
            numpy_helper.from_array(BIAS.astype(dtype), "bias"),
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    onnx.save(model, path)
    return path


def normalized(image: npt.NDArray[np.uint8]) -> npt.NDArray[np.float64]:
    """(H, W) or (H, W, 3) bytes as the network's input (3, H, W), in float64."""
    colour = np.repeat(image[..., None], 3, axis=2) if image.ndim == 2 else image
    return (colour.transpose(2, 0, 1) / 255 - np.reshape(MEAN, (3, 1, 1))) / np.reshape(
        STD, (3, 1, 1)
    )


def feature_map(planes: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """The output ``map`` for one input (3, H, W)."""
    padded = np.pad(planes, ((0, 0), (1, 1), (1, 1)))
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3), axis=(1, 2))[:, ::2, ::2]
    return np.maximum(
        np.einsum("cyxij,kcij->kyx", windows, KERNEL.astype(np.float64)) + BIAS[:, None, None], 0
    )
