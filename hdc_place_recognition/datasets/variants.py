# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Variants of a dataset that test a recognizer: roll, zoom, shift, fewer images, reversed order.

The frames of a variant are computed while they are read. They depend only on the images and the
seed. The ground truth of a variant finds images by their stamps, like that of the dataset.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import cv2
from hdc_place_recognition.datasets.dataset import Frames, GroundTruth, Stamps, Truth
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.results import Frame
import numpy as np
from numpy.typing import NDArray

Image = NDArray[Any]
_SHIFT_SEED = 7  # of the side that a shifted image loses


@dataclass(frozen=True)
class Rolled:
    """
    Images of a camera that rolls about its optical axis.

    The angle of each image is random, of either sign. The image keeps its size and its scale; the
    corners that the turned image does not fill show its mirrored border, so they are not black.

    :param source: the images.
    :param low: smallest angle, degrees.
    :param high: largest angle, degrees.
    :param seed: of the angles.
    :param changed: positions of the images to turn; the rest stays as it is.
    :raises PlaceRecognitionError: the range of angles is empty or not within 0 to 180 degrees.
    """

    source: Frames
    low: float
    high: float
    seed: int
    changed: Collection[int]

    def __post_init__(self) -> None:
        if not 0 <= self.low <= self.high <= 180:
            raise PlaceRecognitionError(
                f'roll {self.low:g} to {self.high:g} degrees: give two rising angles from 0 to 180'
            )

    def __len__(self) -> int:
        return len(self.source)

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames, the chosen ones turned."""
        return _change(self.source, self.changed, lambda i, image: turn(image, self.angle(i)))

    def angle(self, index: int) -> float:
        """Return the angle of an image in degrees, positive counterclockwise."""
        generator = np.random.default_rng([self.seed, index])
        return float(generator.uniform(self.low, self.high) * generator.choice([-1, 1]))


@dataclass(frozen=True)
class Zoomed:
    """
    Images of a camera that is nearer to the scene or further away.

    :param source: the images.
    :param factor: scale about the middle. Below 1 the missing border is filled with the mirrored
        image.
    :param changed: positions of the images to zoom; the rest stays as it is.
    :raises PlaceRecognitionError: the factor is not positive.
    """

    source: Frames
    factor: float
    changed: Collection[int]

    def __post_init__(self) -> None:
        if not self.factor > 0:
            raise PlaceRecognitionError(f'zoom {self.factor:g}: must be above 0')

    def __len__(self) -> int:
        return len(self.source)

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames, the chosen ones zoomed."""
        return _change(self.source, self.changed, lambda _, image: turn(image, 0.0, self.factor))


@dataclass(frozen=True)
class Shifted:
    """
    Images of a camera that looks further to the left or to the right.

    An image loses its left or right third (at random, always the same for a position), and above
    and below a sixth each, so that it keeps its aspect; the rest is enlarged to the old size.

    :param source: the images.
    :param changed: positions of the images to shift; the rest stays as it is.
    """

    source: Frames
    changed: Collection[int]

    def __len__(self) -> int:
        return len(self.source)

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames, the chosen ones shifted."""
        return _change(self.source, self.changed, _shift)


@dataclass(frozen=True)
class Thinned:
    """
    Every n-th image with its stamp, as of a camera that takes fewer.

    :param source: the images.
    :param step: n; the first image is kept.
    :raises PlaceRecognitionError: the step is below 1.
    """

    source: Frames
    step: int

    def __post_init__(self) -> None:
        if self.step < 1:
            raise PlaceRecognitionError(f'thin {self.step}: must be at least 1')

    def __len__(self) -> int:
        return -(-len(self.source) // self.step)

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames that are kept."""
        return islice(self.source, 0, None, self.step)


@dataclass(frozen=True)
class First:
    """
    The first images.

    :param source: the images.
    :param count: how many at most.
    """

    source: Frames
    count: int

    def __len__(self) -> int:
        return min(self.count, len(self.source))

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames that are kept."""
        return islice(self.source, self.count)


@dataclass(frozen=True)
class Reversed:
    """
    The images in reverse order, with the same intervals. Iterating holds all images in memory.

    :param source: the images.
    :param mirror_ns: the first stamp plus the last one; a new stamp is this minus the old one.
    """

    source: Frames
    mirror_ns: int

    def __len__(self) -> int:
        return len(self.source)

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames from the last to the first; the stamps increase."""
        for frame in reversed(list(self.source)):
            yield replace(frame, stamp_ns=self.mirror_ns - frame.stamp_ns)


@dataclass(frozen=True)
class ReversedTruth:
    """
    Ground truth of :class:`Reversed` queries.

    :param source: ground truth of the images in their own order.
    :param mirror_ns: the first stamp plus the last one.
    :param one_sequence: whether queries and database images are the same, reversed images; then a
        pair matches if it does in either order, since gt.npz may list only pairs with an older
        image.
    """

    source: GroundTruth
    mirror_ns: int
    one_sequence: bool

    @property
    def summary(self) -> str:
        """Return a short text that says when two images show the same place."""
        return f'{self.source.summary}, reversed'

    def truth(self, query_stamps_ns: Stamps, database_stamps_ns: Stamps) -> Truth:
        """Return the truth for the images with these stamps."""
        queries, database = self.mirror_ns - query_stamps_ns, database_stamps_ns
        if not self.one_sequence:
            return self.source.truth(queries, database)
        database = self.mirror_ns - database_stamps_ns
        forward = self.source.truth(queries, database)
        backward = self.source.truth(database, queries)
        return Truth(forward.hard | backward.hard.T, forward.soft | backward.soft.T)


@dataclass(frozen=True)
class SwappedTruth:
    """
    Ground truth of two traverses of which queries and map are exchanged.

    :param source: ground truth before the exchange.
    """

    source: GroundTruth

    @property
    def summary(self) -> str:
        """Return a short text that says when two images show the same place."""
        return f'{self.source.summary}, swapped'

    def truth(self, query_stamps_ns: Stamps, database_stamps_ns: Stamps) -> Truth:
        """Return the truth for the images with these stamps."""
        found = self.source.truth(database_stamps_ns, query_stamps_ns)
        return Truth(found.hard.T, found.soft.T)


@dataclass(frozen=True)
class AloneTruth:
    """
    Ground truth of the map of two traverses, which revisits no place.

    No pair is hard. A pair is soft, and so ignored, if both images match the same query of the
    two traverses: they show one place for longer than the minimum gap, or one floor of a building.

    :param source: ground truth of the two traverses.
    :param query_stamps_ns: (q,) int64, stamps of all queries.
    """

    source: GroundTruth
    query_stamps_ns: Stamps

    @property
    def summary(self) -> str:
        """Return a short text that says when two images show the same place."""
        return 'nothing is revisited'

    def truth(self, query_stamps_ns: Stamps, database_stamps_ns: Stamps) -> Truth:
        """Return the truth for the images with these stamps."""
        seen = [
            (found.hard | found.soft).astype(np.float32)
            for found in (
                self.source.truth(self.query_stamps_ns, stamps_ns)
                for stamps_ns in (query_stamps_ns, database_stamps_ns)
            )
        ]
        soft = seen[0].T @ seen[1] > 0
        return Truth(np.zeros_like(soft), soft)


@dataclass(frozen=True)
class NothingInCommon:
    """Ground truth of images that share no place: every closure is false."""

    summary: str = 'no image shows the same place'

    def truth(self, query_stamps_ns: Stamps, database_stamps_ns: Stamps) -> Truth:
        """Return that no pair matches."""
        nothing = np.zeros((len(query_stamps_ns), len(database_stamps_ns)), np.bool_)
        return Truth(nothing, nothing)


def turn(image: Image, degrees: float, scale: float = 1.0) -> Image:
    """
    Return an image turned and scaled about its middle, in its own size.

    What the image does not fill shows its mirrored border.

    :param image: (h, w) or (h, w, 3).
    :param degrees: positive counterclockwise.
    :param scale: above 1 enlarges.
    """
    height, width = image.shape[:2]
    matrix = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), degrees, scale)
    return np.asarray(
        cv2.warpAffine(
            image,
            matrix,
            (width, height),
            flags=cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REFLECT,
        )
    )


def _shift(index: int, image: Image) -> Image:
    """Return the right or left two thirds of an image, enlarged to its size."""
    height, width = image.shape[:2]
    kept_width, kept_height = round(width * 2 / 3), round(height * 2 / 3)
    from_left = np.random.default_rng([_SHIFT_SEED, index]).random() < 0.5
    left, top = 0 if from_left else width - kept_width, round(height / 6)
    rows, columns = slice(top, top + kept_height), slice(left, left + kept_width)
    kept = image[rows, columns]
    return np.asarray(cv2.resize(kept, (width, height), interpolation=cv2.INTER_LINEAR))


def _change(
    source: Frames, changed: Collection[int], change: Callable[[int, Image], Image]
) -> Iterator[Frame]:
    """Yield the frames; the images at the given positions are changed."""
    for index, frame in enumerate(source):
        chosen = index in changed
        yield replace(frame, image=change(index, frame.image)) if chosen else frame
