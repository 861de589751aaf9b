# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Dense features of a network trained on ImageNet: EfficientNet-Lite0 up to block 10."""

from __future__ import annotations

import cv2
from hdc_place_recognition.features.local_features import LocalFeatures
from hdc_place_recognition.features.resize import as_bgr, grid, Image, reduce_to_width, restore
from hdc_place_recognition.networks import onnx_graph, runtime, weights
from hdc_place_recognition.networks.cache import cached
import numpy as np
from numpy.typing import NDArray

# Pixels of the network's input from one cell of block 10 to the next.
STRIDE = 16
_SMALLEST = 32


class EfficientNetLite0:
    """
    Describes every cell of block 10's grid, one each 16 x 16 pixels of the reduced image.

    :param image_width: larger images are reduced to this width, pixels.
    :param threads: CPU threads of the network's runtime, 0 for its own choice.
    :raises PlaceRecognitionError: a package or the weights are missing, or the weights damaged.
    """

    def __init__(self, *, image_width: int, threads: int = 0) -> None:
        self.identity = (
            f'efficientnet_lite0 block={onnx_graph.BLOCK} image_width={image_width} '
            f'weights={weights.WEIGHTS_SHA256[:16]}'
        )
        self._image_width = image_width
        self._run = runtime.load(network_graph(), [onnx_graph.FEATURES], threads)

    def extract(self, image: Image) -> LocalFeatures:
        """
        Return the features of a (h, w) gray or (h, w, 3) BGR image, row by row, 112-D.

        :return: k = 0 if all pixels are equal.
        """
        reduced = reduce_to_width(
            as_bgr(image), self._image_width, multiple=STRIDE, smallest=_SMALLEST
        )
        height, width = image.shape[:2]
        pixels = reduced.reshape(-1, 3)
        if np.array_equal(pixels[1:], pixels[:-1]):
            nothing = np.empty((0, onnx_graph.CHANNELS[onnx_graph.FEATURES]), np.float32)
            return LocalFeatures(np.empty((0, 2), np.float32), nothing, width, height)
        features = self._run(normalized(reduced))[0][0]
        points = grid(features.shape[1:], step=STRIDE, first=STRIDE // 2)
        return LocalFeatures(
            keypoints=restore(points, reduced, image),
            descriptors=np.ascontiguousarray(features.reshape(len(features), -1).T),
            width=width,
            height=height,
        )


def network_graph() -> bytes:
    """
    Return the network as an ONNX model, from the cache folder of the user if it is there.

    :raises PlaceRecognitionError: a package or the weights are missing, or the weights damaged.
    """
    version = f'v{onnx_graph.GRAPH_VERSION}-{weights.WEIGHTS_SHA256[:16]}'
    stem = f'efficientnet_lite0-block{onnx_graph.BLOCK}-{version}'
    return cached(
        stem,
        '.onnx',
        onnx_graph.GRAPH_SHA256,
        lambda: onnx_graph.build(weights.read_weights()),
    )


def normalized(image: Image) -> NDArray[np.float32]:
    """Return (h, w, 3) BGR as the network was trained: (1, 3, h, w) RGB, (value - 127) / 128."""
    tensor = cv2.dnn.blobFromImage(image, 1 / 128, mean=(127, 127, 127), swapRB=True)
    return np.asarray(tensor, np.float32)
