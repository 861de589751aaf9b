# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Writes EfficientNet-Lite0 as an ONNX graph.

Architecture: M. Tan and Q. V. Le, "EfficientNet: Rethinking Model Scaling for Convolutional
Neural Networks" (ICML 2019), in the Lite variant by Google: no squeeze-and-excitation, ReLU6
activations. Kernel sizes are taken from the weights. The package onnx is imported when a graph is
built.
"""

from __future__ import annotations

from typing import Any

from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.networks.weights import NEEDS_NO_WEIGHTS, State
import numpy as np
from numpy.typing import NDArray

# Increase this when the graph or its results change, so that old cache files are not used.
GRAPH_VERSION = 1
# SHA-256 hash of the graph from the weights of networks/weights.py, by onnx 1.14 and 1.23.
GRAPH_SHA256 = '4cb0d3adb8d14ec2c7d69be379ffb54acfbb07202afcec50dc7592b46a2e3a3b'
# The output of this block is `features`.
BLOCK = 10
INPUT, FEATURES = 'image', 'features'
CHANNELS = {INPUT: 3, FEATURES: 112}
# Blocks per stage, up to the last block before `features`, and stride of the first block; other
# blocks have stride 1 and a shortcut.
_STAGES = ((1, 1), (2, 2), (2, 2), (3, 2), (3, 1))
_BLOCKS = tuple(
    (1 if number else stride, number > 0) for count, stride in _STAGES for number in range(count)
)
_NORM_EPSILON = 1e-3
# In opset 10 the limits of Clip are attributes; OpenCV 4.6 does not support later opsets.
_OPSET, _IR_VERSION = 10, 5


def build(state: State) -> bytes:
    """
    Return the serialized graph; it depends only on the arguments.

    Input `image`: (1, 3, h, w) float32 RGB, (value - 127) / 128, h and w multiples of 16.
    Output `features`: block 10, (1, 112, h / 16, w / 16).

    :param state: weights by name.
    :raises PlaceRecognitionError: the package onnx is not installed.
    """
    graph = _Graph(state)
    x = graph.convolution(INPUT, '_conv_stem', '_bn0', 'stem', stride=2)
    for number in range(len(_BLOCKS)):
        x = graph.block(x, number, FEATURES if number == BLOCK else f'block{number}')
    return graph.serialize([FEATURES])


def fold(
    state: State, convolution: str, norm: str
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """
    Fold a batch norm into the convolution before it.

    :param state: weights by name.
    :param convolution: name of the convolution.
    :param norm: name of the batch norm.
    :return: kernel (n, c, k, k) and bias (n,), float32.
    """
    mean, variance, gain, offset = (
        state[f'{norm}.{part}'].astype(np.float64)
        for part in ('running_mean', 'running_var', 'weight', 'bias')
    )
    gain = gain / np.sqrt(variance + _NORM_EPSILON)
    kernel = state[f'{convolution}.weight'] * gain[:, None, None, None]
    return kernel.astype(np.float32), (offset - mean * gain).astype(np.float32)


class _Graph:
    """Builds a graph node by node; methods that append nodes return the output name."""

    def __init__(self, state: State) -> None:
        self._state = state
        self._onnx = _import_onnx()
        self._nodes: list[Any] = []
        self._constants: list[Any] = []

    def block(self, x: str, number: int, name: str) -> str:
        """Append an inverted residual block: expand, depthwise convolution, project, add."""
        (stride, shortcut), prefix, y = _BLOCKS[number], f'_blocks.{number}.', x
        if f'{prefix}_expand_conv.weight' in self._state:
            y = self.convolution(y, f'{prefix}_expand_conv', f'{prefix}_bn0', f'{name}/expanded')
        y = self.convolution(
            y, f'{prefix}_depthwise_conv', f'{prefix}_bn1', f'{name}/filtered', stride=stride
        )
        y = self.convolution(
            y,
            f'{prefix}_project_conv',
            f'{prefix}_bn2',
            f'{name}/projected' if shortcut else name,
            relu=False,
        )
        return self._append('Add', [x, y], name) if shortcut else y

    def convolution(
        self, x: str, weights: str, norm: str, name: str, *, stride: int = 1, relu: bool = True
    ) -> str:
        """Append a convolution with `same` padding, its batch norm and ReLU6."""
        kernel, bias = fold(self._state, weights, norm)
        y = self._append(
            'Conv',
            [x, self._constant(kernel, f'{name}/kernel'), self._constant(bias, f'{name}/bias')],
            f'{name}/linear' if relu else name,
            kernel_shape=kernel.shape[2:],
            strides=[stride, stride],
            group=len(kernel) if kernel.shape[1] == 1 else 1,
            pads=_same_padding(kernel.shape[2], stride),
        )
        return self._append('Clip', [y], name, min=0.0, max=6.0) if relu else y

    def serialize(self, outputs: list[str]) -> bytes:
        """Return the serialized graph with the given outputs."""
        helper = self._onnx.helper
        tensors = {
            name: helper.make_tensor_value_info(
                name, self._onnx.TensorProto.FLOAT, [1, channels, f'{name}_h', f'{name}_w']
            )
            for name, channels in CHANNELS.items()
        }
        graph = helper.make_graph(
            self._nodes,
            'efficientnet_lite0',
            [tensors[INPUT]],
            [tensors[name] for name in outputs],
            self._constants,
        )
        model = helper.make_model(
            graph, ir_version=_IR_VERSION, opset_imports=[helper.make_opsetid('', _OPSET)]
        )
        serialized: bytes = model.SerializeToString(deterministic=True)
        return serialized

    def _constant(self, values: NDArray[np.float32], name: str) -> str:
        self._constants.append(self._onnx.numpy_helper.from_array(values, name))
        return name

    def _append(self, kind: str, inputs: list[str], name: str, **attributes: Any) -> str:
        node = self._onnx.helper.make_node(kind, inputs, [name], name=name, **attributes)
        self._nodes.append(node)
        return name


def _same_padding(width: int, stride: int) -> list[int]:
    """
    Return the `same` padding of TensorFlow for an even size; an odd pixel is added at the end.

    Explicit padding is used because OpenCV 5.0 computes auto_pad=SAME_UPPER wrongly.
    """
    before, after = (width - stride) // 2, (width - stride + 1) // 2
    return [before, before, after, after]


def _import_onnx() -> Any:
    """Import onnx only when a graph is built; the graph is cached afterwards."""
    try:
        import onnx
    except ImportError as error:
        raise PlaceRecognitionError(
            f'the package onnx is missing: `pip install onnx`, or {NEEDS_NO_WEIGHTS}'
        ) from error
    return onnx
