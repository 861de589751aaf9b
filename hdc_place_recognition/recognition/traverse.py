# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The state of one traverse: one camera on one way through the world."""

from __future__ import annotations

from hdc_place_recognition.camera import Camera
from hdc_place_recognition.database.base import Query
from hdc_place_recognition.features.cells import CellEncoder
from hdc_place_recognition.hdc.sequence import SequenceBundler
from hdc_place_recognition.hdc.words import KEYPOINTS, WordHasher
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.frame_filter import FrameFilter
from hdc_place_recognition.recognition.image_encoder import EncodedImage
from hdc_place_recognition.recognition.keyframes import KeyframeSelector, no_odometry, Odometry
from hdc_place_recognition.verification.settings import VerificationSettings
from hdc_place_recognition.verification.state import VerificationState
from hdc_place_recognition.verification.static_content import StaticContent
import numpy as np
from numpy.typing import NDArray


class Traverse:
    """
    All that the recognizer remembers from one image to the next, besides the database.

    Two cameras, or two sessions, are two traverses; they share the database and nothing else. A
    clock that is set back ends a traverse and begins the next one.

    :param number: keyframes of one number follow each other.
    :param params: fix the sequence of images that are bundled.
    :param settings: of verification.
    :param hasher: turns keypoints into words.
    :param clock_ns: time at the start, so that keyframes of earlier traverses are older.
    :param session: number of the session; within a session no stamp occurs twice.
    :ivar camera: that takes the images, None if it is not calibrated; may be replaced.
    :ivar odometry: returns the pose of the robot at a stamp; may be replaced.
    """

    def __init__(
        self,
        number: int,
        params: Params,
        settings: VerificationSettings,
        hasher: WordHasher,
        clock_ns: int = 0,
        session: int = 0,
    ) -> None:
        self.number, self.session = number, session
        self.filter = FrameFilter(clock_ns)
        self.sequence = SequenceBundler(
            dimensions=params.dimensions, length=params.sequence_length, seed=params.seed
        )
        self.keyframes = KeyframeSelector()
        self.verification = VerificationState.new(settings, number)
        self.camera: Camera | None = None
        self.odometry: Odometry = no_odometry
        self._cells, self._static = CellEncoder(), StaticContent()
        self._hasher = hasher

    def continue_camera(self, before: Traverse) -> None:
        """Take over what belongs to the camera of another traverse: calibration and statistics."""
        self.camera, self.odometry = before.camera, before.odometry
        self._cells, self._static = before._cells, before._static
        self.verification.background = before.verification.background

    def query(self, stamp_ns: int, encoded: EncodedImage, params: Params) -> Query:
        """Return an image as a query: with the sequence it ends, and without static content."""
        vectors = self.sequence.push(encoded.vectors)
        unshifted = vectors[len(vectors) // 2]
        novelty = self.keyframes.novelty(unshifted)
        moved = self.keyframes.moved(unshifted, self.odometry(stamp_ns), params)
        if moved and encoded.grid is not None:
            self._cells.update(encoded.grid)
        words, static, pixels = self._words(encoded)
        return Query(
            stamp_ns=stamp_ns,
            vectors=vectors,
            keypoints=encoded.keypoints,
            words=words,
            static=static,
            pixels=pixels,
            cells=None if encoded.grid is None else self._cells.encode(encoded.grid),
            traverse=self.number,
            novelty=novelty,
            moved=moved,
        )

    def count_static(self, query: Query) -> None:
        """Count the keypoints of a query that is a keyframe, and no view of a known place."""
        if query.pixels is not None:
            self._static.count(query.pixels)

    def _words(
        self, encoded: EncodedImage
    ) -> tuple[NDArray[np.int32] | None, NDArray[np.bool_] | None, NDArray[np.int32] | None]:
        """Return words, which keypoints are static content, and symbols bound to pixels."""
        if encoded.keypoints is None or encoded.symbols is None:
            return None, None, None
        pixels = self._static.codes(encoded.symbols, encoded.keypoints.points[:KEYPOINTS])
        found = self._static.static(pixels)
        static = np.zeros(len(encoded.keypoints), np.bool_)
        static[: len(found)] = found
        return self._hasher.words(encoded.symbols[~found]), static, pixels
