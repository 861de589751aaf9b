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
    :param pooled: whether to go on to the end of the network for a vector of the whole image.
    :raises PlaceRecognitionError: a package or the weights are missing, or the weights damaged.
    """

    def __init__(self, *, image_width: int, threads: int = 0, pooled: bool = False) -> None:
        self.identity = (
            f'efficientnet_lite0 block={onnx_graph.BLOCK} image_width={image_width} '
            f'weights={weights.WEIGHTS_SHA256[:16]}' + (' pooled=gem3' if pooled else '')
        )
        self._image_width = image_width
        outputs = [onnx_graph.FEATURES, onnx_graph.HEAD] if pooled else [onnx_graph.FEATURES]
        self._run = runtime.load(network_graph(head=pooled), outputs, threads)

    def extract(self, image: Image) -> LocalFeatures:
        """
        Return the features of a (h, w) grey or (h, w, 3) BGR image, row by row, 112-D.

        :return: k = 0, and no pooled vector, if all pixels are the same. The pooled vector is the
            generalised mean of the network's last feature map, 1280-D, not negative.
        """
        reduced = reduce_to_width(
            as_bgr(image), self._image_width, multiple=STRIDE, smallest=_SMALLEST
        )
        height, width = image.shape[:2]
        pixels = reduced.reshape(-1, 3)
        if np.array_equal(pixels[1:], pixels[:-1]):
            nothing = np.empty((0, onnx_graph.CHANNELS[onnx_graph.FEATURES]), np.float32)
            return LocalFeatures(np.empty((0, 2), np.float32), nothing, width, height)
        features, *head = (output[0] for output in self._run(normalised(reduced)))
        points = grid(features.shape[1:], step=STRIDE, first=STRIDE // 2)
        return LocalFeatures(
            keypoints=restore(points, reduced, image),
            descriptors=np.ascontiguousarray(features.reshape(len(features), -1).T),
            width=width,
            height=height,
            pooled=generalised_mean(head[0]) if head else None,
        )


def network_graph(*, head: bool) -> bytes:
    """
    Return the network as an ONNX model, from the user's cache folder if it is there.

    :param head: whether it goes on from block 10 to the last convolution.
    :raises PlaceRecognitionError: a package or the weights are missing, or the weights damaged.
    """
    part = onnx_graph.HEAD if head else f'block{onnx_graph.BLOCK}'
    stem = f'efficientnet_lite0-{part}-v{onnx_graph.GRAPH_VERSION}-{weights.WEIGHTS_SHA256[:16]}'
    return cached(stem, '.onnx', lambda: onnx_graph.build(weights.read_weights(), head=head))


def normalised(image: Image) -> NDArray[np.float32]:
    """Return (h, w, 3) BGR as the network was trained: (1, 3, h, w) RGB, (value - 127) / 128."""
    tensor = cv2.dnn.blobFromImage(image, 1 / 128, mean=(127, 127, 127), swapRB=True)
    return np.asarray(tensor, np.float32)


def generalised_mean(maps: NDArray[np.float32]) -> NDArray[np.float32]:
    """
    Return the cubic mean of each map (GeM with p = 3: Radenovic et al., TPAMI 2019).

    :param maps: (c, h, w), not negative.
    :return: (c,).
    """
    return np.cbrt(np.mean(maps * maps * maps, axis=(1, 2)))
