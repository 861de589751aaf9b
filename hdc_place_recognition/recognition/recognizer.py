# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The recognizer that the node and the offline tools share."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from hdc_place_recognition.conversions.pixels import as_uint8
from hdc_place_recognition.database.base import (
    Added,
    Keyframe,
    KeyframeDatabase,
    Query,
    SearchResult,
)
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.hdc.algebra import Hypervector
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.frame_filter import nanoseconds
from hdc_place_recognition.recognition.image_encoder import EncodedImage, ImageEncoder
from hdc_place_recognition.recognition.stopwatch import Stopwatch
from hdc_place_recognition.recognition.traverse import Traverse
from hdc_place_recognition.results import Candidate, Detection, Frame, Status
from hdc_place_recognition.verification.verifier import CandidateVerifier, PROPOSED
import numpy as np
from numpy.typing import NDArray

_DEFAULT_CAMERA = Frame.camera


@dataclass(frozen=True)
class Observation:
    """
    An image as its traverse sees it: with the sequence it ends, and whether the robot moved.

    :param query: what is compared with the keyframes.
    :param camera: name of its camera, and so of its traverse.
    :param clock_ns: time on the clock of the traverse.
    :param n_features: number of local features.
    :param watch: time of the stages so far.
    """

    query: Query
    camera: str
    clock_ns: int
    n_features: int
    watch: Stopwatch = field(default_factory=Stopwatch, compare=False)


class PlaceRecognizer:
    """
    Says for each image which keyframes show the same place, and stores it as a keyframe.

    :param params: may be replaced at any time; live parameters take effect with the next image.
    :param encoder: encodes an image.
    :param database: stores and finds keyframes.
    :param verifier: decides which of those found are loop closures.
    """

    def __init__(
        self,
        params: Params,
        encoder: ImageEncoder,
        database: KeyframeDatabase,
        verifier: CandidateVerifier,
    ) -> None:
        self.params, self.database = params, database
        self._encoder, self._verifier = encoder, verifier
        self._traverses: dict[str, Traverse] = {}
        # By the number of the traverse.
        self._sessions: list[int] = []

    @property
    def identity(self) -> str:
        """Return method, settings and weights of the local features in words."""
        return self._encoder.identity

    @property
    def verifies(self) -> bool:
        """Return whether candidates are verified by their geometry."""
        return self._encoder.verifies

    def process(self, frame: Frame, params: Params | None = None) -> Detection:
        """
        Compare an image with the keyframes, then store it: one step of a robot.

        :param frame: its stamp decides whether it is processed at all.
        :param params: a snapshot to use instead of the current parameters.
        :raises PlaceRecognitionError: it is no image; nothing is changed then.
        """
        params, image = params or self.params, as_uint8(frame.image)
        # 1 Skip frames that come too soon.
        skipped = self.skip_reason(frame.stamp_ns, frame.camera, params)
        if skipped is not None:
            return Detection(frame.stamp_ns, skipped)
        traverse = self._continued(frame)
        traverse.filter.accept(frame.stamp_ns, nanoseconds(params.min_interval_s))
        # 2 Encode: local features to one hypervector (Eq. 4), keypoints for verification.
        watch = Stopwatch()
        encoded = self._encoder.encode(image, watch)
        query = self._query(frame.stamp_ns, encoded, traverse, params, watch)
        traverse.filter.note_motion(query.moved)
        # 3 Search the database, without the most recent keyframes.
        result = self._search(
            query,
            params,
            watch,
            before_ns=traverse.filter.clock_ns - nanoseconds(params.exclude_recent_s),
            skip_newest=params.exclude_recent_frames,
        )
        # 4 Verify the candidates: geometry, temporal consistency, score.
        candidates = self._verify(query, result, traverse, params, watch)
        # 5 Store the image if it is a new keyframe.
        added, not_stored = self._store(query, traverse, result, watch)
        self._note(query, traverse, candidates, added)
        return _detection(query, encoded.n_features, result, candidates, watch, added, not_stored)

    def encode(self, image: NDArray[Any]) -> Hypervector:
        """
        Return the image descriptor (d,) float32, of unit length; leaves no trace.

        :param image: (h, w) gray or (h, w, 3) BGR.
        :raises PlaceRecognitionError: it is no image.
        """
        vectors = self._encoder.encode(as_uint8(image)).vectors
        return vectors[len(vectors) // 2]

    def skip_reason(
        self, stamp_ns: int, camera: str = _DEFAULT_CAMERA, params: Params | None = None
    ) -> Status | None:
        """Return why a frame of this stamp would be skipped, None if it would not."""
        interval_ns = nanoseconds((params or self.params).min_interval_s)
        return self.traverse(camera).filter.skip_reason(stamp_ns, interval_ns)

    def begins_session(self, stamp_ns: int, camera: str = _DEFAULT_CAMERA) -> bool:
        """Return whether the next frame, with this stamp, begins a session: time was set back."""
        return self.traverse(camera).filter.begins_session(stamp_ns)

    def traverse(self, camera: str = _DEFAULT_CAMERA) -> Traverse:
        """Return the traverse of a camera; its calibration and odometry may be set there."""
        return self._traverses.get(camera) or self._new_traverse(camera)

    def start_traverse(self, camera: str = _DEFAULT_CAMERA) -> Traverse:
        """Begin another session: the next image does not continue those before it."""
        before = self._traverses.get(camera)
        traverse = self._new_traverse(camera)
        if before is not None:
            traverse.continue_camera(before)
        return traverse

    def warm_up(self, width: int, height: int) -> None:
        """Make the first image of this size take no longer than others; leaves no trace."""
        self._encoder.warm_up(width, height)
        self._verifier.warm_up()

    def observe(self, frame: Frame) -> Observation:
        """
        Take an image into its traverse and into the mean of the database, whatever its stamp.

        For evaluations that store and ask in an order of their own; a robot calls :meth:`process`.
        """
        params, watch, traverse = self.params, Stopwatch(), self.traverse(frame.camera)
        encoded = self._encoder.encode(as_uint8(frame.image), watch)
        query = self._query(frame.stamp_ns, encoded, traverse, params, watch)
        return Observation(
            query, frame.camera, traverse.filter.clock_ns, encoded.n_features, watch
        )

    def recognize(self, observation: Observation, *, without: int | None = None) -> Detection:
        """
        Compare an observation with all keyframes, and store nothing.

        :param without: id of a keyframe that is no candidate, such as the image itself.
        """
        params, watch = self.params, Stopwatch(observation.watch.milliseconds)
        query, traverse = observation.query, self.traverse(observation.camera)
        result = self._search(query, params, watch, without=without)
        candidates = self._verify(query, result, traverse, params, watch)
        return _detection(query, observation.n_features, result, candidates, watch)

    def store(self, observation: Observation) -> Added:
        """
        Store an observation as a keyframe, if it shows something new.

        :raises PlaceRecognitionError: there is no storage for it; nothing is changed.
        """
        traverse, query = self.traverse(observation.camera), observation.query
        if query.empty or not query.moved:
            return Added()
        added = self.database.add(_keyframe(query, traverse.number, observation.clock_ns))
        self._note(query, traverse, (), added)
        return added

    def _continued(self, frame: Frame) -> Traverse:
        """Return the traverse that a frame continues or, if the clock was set back, begins."""
        if self.begins_session(frame.stamp_ns, frame.camera):
            return self.start_traverse(frame.camera)
        return self.traverse(frame.camera)

    def _new_traverse(self, camera: str) -> Traverse:
        known = self._traverses.values()
        clock_ns = max((traverse.filter.clock_ns for traverse in known), default=0)
        if camera in self._traverses:
            session = self._traverses[camera].session + 1
        else:
            session = max((traverse.session for traverse in known), default=0)
        traverse = Traverse(
            len(self._sessions),
            self.params,
            self._verifier.settings,
            self._encoder.hasher,
            clock_ns,
            session,
        )
        self._traverses[camera] = traverse
        self._sessions.append(session)
        return traverse

    def _query(
        self,
        stamp_ns: int,
        encoded: EncodedImage,
        traverse: Traverse,
        params: Params,
        watch: Stopwatch,
    ) -> Query:
        """Return the query of an image in its traverse; update the mean if the robot moved."""
        with watch.stage('encode'):
            query = traverse.query(stamp_ns, encoded, params)
        if query.moved and not query.empty:
            with watch.stage('query'):
                self.database.update_mean(query)
        return query

    def _search(
        self,
        query: Query,
        params: Params,
        watch: Stopwatch,
        *,
        before_ns: int | None = None,
        skip_newest: int = 0,
        without: int | None = None,
    ) -> SearchResult:
        with watch.stage('query'):
            return self.database.search(
                query,
                max(params.top_k, params.verify_top_k, PROPOSED),
                before_ns=before_ns,
                skip_newest=skip_newest,
                without=without,
                exact=params.exact,
            )

    def _verify(
        self,
        query: Query,
        result: SearchResult,
        traverse: Traverse,
        params: Params,
        watch: Stopwatch,
    ) -> tuple[Candidate, ...]:
        if query.empty:
            return ()
        other_visits = self._other_visits(query, traverse, params)
        with watch.stage('query' if query.keypoints is None else 'verify'):
            found = self._verifier.verify(
                query, result, traverse.verification, traverse.camera, params, other_visits
            )
        return tuple(self._with_sessions(candidate, traverse.session) for candidate in found)

    def _other_visits(self, query: Query, traverse: Traverse, params: Params) -> NDArray[np.int64]:
        """Return the keyframes that appearance alone may match: of another session, or old."""
        if query.cells is None or not params.allow_appearance_closures:
            return np.empty(0, np.int64)
        before_ns = traverse.filter.clock_ns - nanoseconds(params.appearance_gap_s)
        return self.database.other_visits(traverse.number, before_ns)

    def _with_sessions(self, candidate: Candidate, session: int) -> Candidate:
        matched = self._sessions[self.database.get(candidate.match_id).traverse]
        return replace(candidate, query_session=session, match_session=matched)

    def _store(
        self, query: Query, traverse: Traverse, result: SearchResult, watch: Stopwatch
    ) -> tuple[Added, str]:
        """Return what became of the keyframe, and why there was no room for it."""
        twin = result.matches[0].keyframe_id if result.matches else None
        with watch.stage('insert'):
            if query.empty or not query.moved:
                return Added(), ''
            try:
                keyframe = _keyframe(query, traverse.number, traverse.filter.clock_ns, twin)
                return self.database.add(keyframe), ''
            except PlaceRecognitionError as error:
                return Added(), str(error)

    def _note(
        self,
        query: Query,
        traverse: Traverse,
        candidates: tuple[Candidate, ...],
        added: Added,
    ) -> None:
        """Remember what a new keyframe shows, and forget evicted ones."""
        best = next((found.match_id for found in candidates if found.accepted), None)
        if added.keyframe_id is not None:
            self._verifier.note_keyframe(query, added.keyframe_id, best, traverse.verification)
            if best is None:
                traverse.count_static(query)
        for keyframe_id in added.evicted:
            self._verifier.links.evict(keyframe_id)


def _keyframe(query: Query, traverse: int, clock_ns: int, twin: int | None = None) -> Keyframe:
    return Keyframe(
        stamp_ns=query.stamp_ns,
        clock_ns=clock_ns,
        vector=query.unshifted,
        keypoints=query.keypoints,
        words=query.words,
        cells=query.cells,
        traverse=traverse,
        twin=twin,
    )


def _detection(
    query: Query,
    n_features: int,
    result: SearchResult,
    candidates: tuple[Candidate, ...],
    watch: Stopwatch,
    added: Added | None = None,
    not_stored: str = '',
) -> Detection:
    added = added or Added()
    given = {} if result.similarities is None else {'similarities': result.similarities}
    return Detection(
        stamp_ns=query.stamp_ns,
        status=_status(query, candidates),
        candidates=candidates,
        keyframe_id=added.keyframe_id,
        not_stored=not_stored,
        evicted_ids=added.evicted,
        n_features=n_features,
        milliseconds=watch.milliseconds,
        **given,
    )


def _status(query: Query, candidates: tuple[Candidate, ...]) -> Status:
    """Return what became of an image that was compared."""
    if query.empty:
        return Status.NO_FEATURES
    if not candidates:
        return Status.DATABASE_TOO_YOUNG
    accepted = any(candidate.accepted for candidate in candidates)
    return Status.ACCEPTED if accepted else Status.BELOW_THRESHOLD
