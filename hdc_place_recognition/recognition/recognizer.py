# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The recogniser: what the node and the offline tools both run."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from hdc_place_recognition.camera import Camera
from hdc_place_recognition.conversions.pixels import as_uint8
from hdc_place_recognition.database.eviction import Limit
from hdc_place_recognition.database.memory import Database
from hdc_place_recognition.database.vector_store import Rows
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.features.local_features import Extractor
from hdc_place_recognition.hdc.sequence import SequenceBundler
from hdc_place_recognition.hdc.shifts import Shifts
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.frame_filter import nanoseconds, StampSelector
from hdc_place_recognition.recognition.image_encoder import Looker
from hdc_place_recognition.recognition.keyframes import KeyframeSelector, no_odometry, Odometry
from hdc_place_recognition.recognition.stopwatch import Stopwatch
from hdc_place_recognition.results import Candidate, Description, Detection, status_of
from hdc_place_recognition.verification.verifier import Judge
from numpy.typing import NDArray


class PlaceRecognizer:
    """
    Tells of each image which earlier ones show the same place.

    :param params: may be replaced at any time; live parameters take effect with the next image.
    :param extractor: of local features.
    :param keypoints: extractor of what candidates are verified by, None to verify none.
    :param rows: where the vectors of the database will be, in memory by default.
    :ivar odometry: asked for the robot's pose at the stamp of each image; may be replaced.
    """

    def __init__(
        self,
        params: Params,
        extractor: Extractor,
        keypoints: Extractor | None = None,
        rows: Rows | None = None,
    ) -> None:
        self.params = params
        shifts = Shifts(params.displacements_x, params.displacements_y, params.displacement_step)
        self.database = Database(
            Rows(params.dimensions) if rows is None else rows,
            len(shifts.offsets),
            params.center_database,
            extractor.identity,
            shifts.groups,
            Limit(params.max_keyframes, params.max_database_mb),
        )
        self._looker = Looker(params, extractor, keypoints, shifts)
        self._sequence = SequenceBundler(
            dimensions=params.dimensions, length=params.sequence_length, seed=params.seed
        )
        self.selector = StampSelector()
        self._judge = Judge(shifts.offsets)
        self._keyframes = KeyframeSelector()
        self.odometry: Odometry = no_odometry

    @property
    def verifies(self) -> bool:
        """Return whether candidates are verified by their geometry."""
        return self._looker.verifies

    @property
    def camera(self) -> Camera | None:
        """Return the camera, if it is calibrated; accepted candidates tell its rotation then."""
        return self._judge.camera

    @camera.setter
    def camera(self, camera: Camera | None) -> None:
        self._judge.camera = camera

    def warm_up(self, width: int, height: int) -> None:
        """Make the first image of this size take no longer than others; leaves no trace."""
        self._looker.warm_up(width, height)

    def process(self, stamp_ns: int, image: NDArray[Any]) -> Detection:
        """
        Compare an image with those before it, then add it to them: the step of a robot.

        :param stamp_ns: header stamp of the image; decides whether it is processed at all.
        :param image: (h, w) grey or (h, w, 3) BGR.
        :raises PlaceRecognitionError: it is no image; nothing is changed then.
        """
        image = as_uint8(image)
        skipped = self.selector.admit(stamp_ns, nanoseconds(self.params.min_interval_s))
        if skipped is not None:
            return Detection(stamp_ns, skipped)
        description = self.describe(stamp_ns, image)
        self.selector.note_motion(description.moved)
        detection = self.recognize(description, rows=self._old_enough())
        watch = Stopwatch(detection.milliseconds)
        try:
            with watch.stage('insert'):
                detection = replace(detection, keyframe_id=self.learn(description))
        except PlaceRecognitionError as error:
            detection = replace(detection, not_stored=str(error))
        forgotten = tuple(each.keyframe_id for each in self.database.last_forgotten)
        return replace(detection, forgotten_ids=forgotten, milliseconds=watch.milliseconds)

    def describe(self, stamp_ns: int, image: NDArray[Any]) -> Description:
        """
        Look at an image: return its hypervectors, or those of the sequence it ends.

        An image of a robot that stands still does not count for the means.
        """
        watch, image = Stopwatch(), as_uint8(image)
        sight = self._looker.look(image, watch)
        with watch.stage('encode'):
            query = self._sequence.push(sight.vectors)
        pose = self.odometry(stamp_ns)
        moved = self._keyframes.moved(query[len(query) // 2], pose, self.params)
        if moved and query.any():
            with watch.stage('query'):
                self.database.see(query)
        return Description(
            stamp_ns,
            query,
            sight.n_features,
            moved,
            sight.landmarks,
            milliseconds=watch.milliseconds,
        )

    def recognize(
        self, description: Description, *, rows: int | None = None, skip_id: int | None = None
    ) -> Detection:
        """
        Compare an image with those of the database, and store nothing there.

        Images that are asked for one after the other support each other.

        :param rows: only the first rows may be candidates; all by default.
        :param skip_id: a keyframe that may not: the image itself, when all are compared with all.
        """
        watch = Stopwatch(description.milliseconds)
        with watch.stage('query'):
            answer = self.database.ask(description.query, rows, exact=self.params.exact)
        skip_row = None if skip_id is None else self.database.row(skip_id)
        candidates: tuple[Candidate, ...] = ()
        if not description.empty:
            with watch.stage('query' if description.landmarks is None else 'verify'):
                candidates = self._judge.candidates(
                    description, answer, self.database, self.params, skip_row
                )
        return Detection(
            description.stamp_ns,
            status_of(description, candidates),
            candidates,
            answer.similarities,
            n_features=description.n_features,
            milliseconds=watch.milliseconds,
        )

    def learn(self, description: Description) -> int | None:
        """
        Store an image and return its number.

        :return: None where nothing, or nothing new, is seen, or a full database needs it not.
        :raises PlaceRecognitionError: there is no room for it; nothing is changed.
        """
        if description.empty or not description.moved:
            self.database.last_forgotten = ()
            return None
        stamp_ns, query = description.stamp_ns, description.query
        clock_ns, landmarks = self.selector.clock_ns, description.landmarks
        keyframe_id = self.database.add(stamp_ns, clock_ns, query, landmarks)
        for forgotten in self.database.last_forgotten:
            self._judge.consistency.forget(forgotten.row)
        return keyframe_id

    def start_sequence(self) -> None:
        """Begin another traverse: what comes next does not continue what came before."""
        self._sequence.clear()
        self.selector.restart()
        self._judge.consistency.clear()
        self._keyframes.restart()

    def _old_enough(self) -> int:
        """Return how many rows are old enough to be candidates: the first ones."""
        limit_ns = self.selector.clock_ns - nanoseconds(self.params.exclude_recent_s)
        return self.database.older_than(limit_ns, self.params.exclude_recent_frames)
