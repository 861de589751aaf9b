# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Which candidates are loop closures: verification of the matches that the database found."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

from hdc_place_recognition.camera import Camera, Quaternion
from hdc_place_recognition.database.base import (
    KeyframeDatabase,
    Match,
    PLACE_RADIUS,
    Query,
    SearchResult,
)
from hdc_place_recognition.features.compact import KEYPOINT_WIDTH, quantize
from hdc_place_recognition.features.local_features import LocalFeatures
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.results import Candidate, NOT_VERIFIED, Reason
from hdc_place_recognition.verification.appearance import (
    CellComparison,
    follow_path,
    learn_own_background,
)
from hdc_place_recognition.verification.geometry import Geometry, verify_geometry
from hdc_place_recognition.verification.path import PathMatch
from hdc_place_recognition.verification.places import PlaceLinks
from hdc_place_recognition.verification.rotation import relative_rotation
from hdc_place_recognition.verification.scoring import Evidence, Scorer
from hdc_place_recognition.verification.settings import VerificationSettings
from hdc_place_recognition.verification.state import VerificationState
from hdc_place_recognition.verification.static_content import agreement_elsewhere
import numpy as np
from numpy.typing import NDArray

# Matches that are ordered by the dense cells before they are verified.
PROPOSED = 8
# Of verify_top_k matches, so many are the best by words alone, and one is the most distinct.
_BY_WORDS = 3
# The last image's place supports a look at the keyframes next to it from this certainty on.
_NEXT_FROM = 0.3
# Keyframes before and after it, where the camera may be now.
_NEXT_BEFORE, _NEXT_AFTER = 2, (1, 3)
# The neighbors of the best match are verified so many times.
_CLIMBS = 3
# Other keyframes of the best place that may be accepted with it.
_SAME_PLACE = 5
_HALF = 0.5
# Keyframes that may be accepted beside that of a path.
_NEXT_TO_PATH = 2
# The background of dense cells is learned from so many keyframes before a new one, without the
# newest, which may show its place.
_BEFORE_IT, _MAY_SHOW_IT = 200, 10


@dataclass(frozen=True)
class Hypothesis:
    """
    A match that may be the place of the query.

    :param match: found by the database.
    :param geometry: None if it was not verified.
    :param evidence: for it.
    :param score: probability of a true closure; 0 if it was not verified.
    :param reason: why it is not accepted.
    """

    match: Match
    geometry: Geometry | None
    evidence: Evidence
    score: float = 0.0
    reason: Reason = Reason.NOT_VERIFIED

    @property
    def keyframe_id(self) -> int:
        """Return the id of the keyframe."""
        return self.match.keyframe_id


class CandidateVerifier:
    """
    Verifies the matches of one image after the other.

    :param database: that found them.
    :param offsets: (s, 2) float32, the shifts under which images are compared.
    :param scorer: weighs the evidence.
    """

    def __init__(
        self, database: KeyframeDatabase, offsets: NDArray[np.float32], scorer: Scorer
    ) -> None:
        self._database, self._offsets, self._scorer = database, offsets, scorer
        self.settings = scorer.settings
        self.links = PlaceLinks(self.settings.elsewhere)

    def verify(
        self,
        query: Query,
        result: SearchResult,
        state: VerificationState,
        camera: Camera | None,
        params: Params,
        other_visits: NDArray[np.int64],
    ) -> tuple[Candidate, ...]:
        """
        Return the candidates of an image, best first, accepted or not.

        :param query: the image.
        :param result: what the database found for it.
        :param state: of the traverse; takes the image in.
        :param camera: that took the image, None if it is not calibrated.
        :param params: read are top_k, verify_top_k, min_score and allow_appearance_closures.
        :param other_visits: ids of keyframes that appearance alone may match, rising.
        """
        if not result.matches:
            return ()
        if query.keypoints is None:
            ranked = self._without_geometry(result)
        else:
            image = _ImageVerification(query, result, self._database, self.settings)
            ranked = self._verified(image, state, params)
            if query.moved and params.allow_appearance_closures and len(other_visits):
                proposals = [match.keyframe_id for match in result.matches[:PROPOSED]]
                path = follow_path(image.comparison, proposals, other_visits, state)
                ranked = self._with_path(ranked, path, result, params.min_score)
        return tuple(
            self._candidate(found, query, camera, params.min_score)
            for found in ranked[: params.top_k]
        )

    def warm_up(self) -> None:
        """Make the libraries set up what they set up on first use; leaves no trace."""
        rng = np.random.default_rng(0)
        keypoints = quantize(
            LocalFeatures(
                keypoints=rng.uniform(0, 200, (50, 2)).astype(np.float32),
                descriptors=rng.random((50, 128), np.float32),
                width=KEYPOINT_WIDTH,
                height=240,
                sizes=np.full(50, 4, np.float32),
                angles=np.zeros(50, np.float32),
            )
        )
        verify_geometry(keypoints, keypoints)

    def note_keyframe(
        self, query: Query, keyframe_id: int, place_id: int | None, state: VerificationState
    ) -> None:
        """
        Note a new keyframe.

        :param query: the image, as it was verified.
        :param keyframe_id: its id.
        :param place_id: the keyframe whose place it was accepted to show, None if it is new.
        :param state: of the traverse.
        """
        if place_id is not None:
            self.links.accept(keyframe_id, place_id)
        near = self._database.near(keyframe_id, _BEFORE_IT)
        own = np.array([found for found in near if found < keyframe_id], np.int64)
        learn_own_background(CellComparison(query, self._database), own[:-_MAY_SHOW_IT], state)

    def _without_geometry(self, result: SearchResult) -> list[Hypothesis]:
        """Return the matches by similarity alone; only the best one can be the place."""
        count = result.background.count
        found = [
            Hypothesis(match, None, self._scorer.unverified_evidence(match, count))
            for match in result.matches
        ]
        scores = [self._scorer.unverified.score(hypothesis.evidence.total) for hypothesis in found]
        most = scores[0]
        ranked = [replace(found[0], score=most, reason=found[0].evidence.reason)]
        for hypothesis, score in zip(found[1:], scores[1:], strict=True):
            limited = min(score, 1 - most)
            reason = Reason.ANOTHER_PLACE if limited < score else hypothesis.evidence.reason
            ranked.append(replace(hypothesis, score=limited, reason=reason))
        return ranked

    def _verified(
        self, image: _ImageVerification, state: VerificationState, params: Params
    ) -> list[Hypothesis]:
        """Return the matches of an image with keypoints, best first."""
        for keyframe_id in self._worth_verifying(image, state, params.verify_top_k):
            image.verify([keyframe_id])
            if image.certain:
                break
        for _ in range(_CLIMBS):
            image.verify(self._database.near(image.strongest, 1))
        hypotheses = [self._hypothesis(match, image, state) for match in image.matches.values()]
        best = max(hypotheses, key=lambda found: found.evidence.total)
        if image.query.moved:
            rivals = self._rivals(best, hypotheses)
            certainty = self._scorer.certainty(best.evidence, rivals)
            state.temporal.remember(best.keyframe_id, certainty)
        ranked = self._rank(hypotheses, best, image.comparison, params.min_score)
        evidence = self._scorer.unverified_evidence
        count = image.result.background.count
        return ranked + [
            Hypothesis(match, None, evidence(match, count))
            for match in image.result.matches
            if match.keyframe_id not in image.matches
        ]

    def _worth_verifying(
        self, image: _ImageVerification, state: VerificationState, count: int
    ) -> list[int]:
        """Return the ids of the matches to verify, from independent sources."""
        proposed = [match.keyframe_id for match in image.result.matches[:PROPOSED]]
        ids = proposed[:1]
        if image.comparison.possible:
            # Stable: of equal ones the more distinct comes first.
            proposed = sorted(proposed[1:], key=image.comparison.of, reverse=True)
        else:
            proposed = proposed[1:]
        by_words = min(_BY_WORDS, count // 2)
        ids += proposed[: max(count - 1 - by_words, 0)]
        words = (match.keyframe_id for match in image.result.by_words)
        ids += [found for found in self._apart(words, ids) if found not in ids][:by_words]
        last = state.temporal.last
        if last is not None and last[1] > _NEXT_FROM:
            ids += [found for found in self._next_to(last[0]) if found not in ids]
        return ids

    def _apart(self, candidates: Iterable[int], taken: Sequence[int]) -> list[int]:
        """Return the keyframes that do not show the place of one that is taken."""
        distances = self._database.distance
        return [
            found
            for found in candidates
            if all(
                (apart := distances(found, known)) is None or apart > PLACE_RADIUS
                for known in taken
            )
        ]

    def _next_to(self, keyframe_id: int) -> list[int]:
        """Return a keyframe and those before and after it where the camera may be now."""
        near = self._database.near(keyframe_id, max(_NEXT_AFTER))
        before = [found for found in near if found < keyframe_id]
        after = [found for found in near if found > keyframe_id]
        steps = [after[step - 1] for step in _NEXT_AFTER if step <= len(after)]
        return [keyframe_id, *steps, *before[-_NEXT_BEFORE:][:1]]

    def _hypothesis(
        self, match: Match, image: _ImageVerification, state: VerificationState
    ) -> Hypothesis:
        """
        Return a verified match with the evidence for it.

        The keyframes near each other are one place, whose rivals are those of its strongest one.
        """
        keyframe_id, distance = match.keyframe_id, self._database.distance
        geometry, place = image.geometries[keyframe_id], image.strongest_near(keyframe_id)
        rival = max(
            (
                found.strength
                for rival_id, found in image.geometries.items()
                if self._distinct(rival_id, place.keyframe_id)
            ),
            default=0.0,
        )
        linked = place.rival_id is None or not self._distinct(place.rival_id, place.keyframe_id)
        evidence = self._scorer.evidence(
            match,
            geometry,
            rival_inliers=rival,
            rival_distinctness=0.0 if linked else place.rival_distinctness,
            support=state.temporal.of(keyframe_id, image.query.moved, distance),
        )
        return Hypothesis(match, geometry, evidence)

    def _distinct(self, first_id: int, second_id: int) -> bool:
        return self.links.distinct(first_id, second_id, self._database.distance)

    def _rivals(self, best: Hypothesis, hypotheses: Sequence[Hypothesis]) -> list[Evidence]:
        """Return the evidence for the best match of each other place."""
        rivals: list[Hypothesis] = []
        for found in sorted(hypotheses, key=lambda found: -found.evidence.total):
            known = (best, *rivals)
            if all(self._distinct(found.keyframe_id, place.keyframe_id) for place in known):
                rivals.append(found)
        return [rival.evidence for rival in rivals]

    def _rank(
        self,
        hypotheses: Sequence[Hypothesis],
        best: Hypothesis,
        comparison: CellComparison,
        min_score: float,
    ) -> list[Hypothesis]:
        """
        Return the hypotheses with their scores, best first.

        An image shows one place. Another keyframe is accepted only if it shows the view of the
        best one; if it shows another place, it is true only as far as the best one is not.
        """
        most = self._scorer.score(best.evidence)
        ranked = [replace(best, score=most, reason=best.evidence.reason)]
        for found in hypotheses:
            if found.keyframe_id == best.keyframe_id:
                continue
            score, reason = self._scorer.score(found.evidence), found.evidence.reason
            near = self._near(found, best)
            enough = min(score, most) >= min_score
            shown = near and enough and self._same_view(found, best, comparison)
            if not shown:
                limit = _HALF if near else 1 - most
                reason = reason if score <= limit or near else Reason.ANOTHER_PLACE
                score = min(score, limit)
            ranked.append(replace(found, score=score, reason=reason))
        return ranked[:1] + sorted(
            ranked[1:], key=lambda found: (-found.score, -found.match.distinctness)
        )

    def _near(self, found: Hypothesis, best: Hypothesis) -> bool:
        apart = self._database.distance(found.keyframe_id, best.keyframe_id)
        return apart is not None and apart <= _SAME_PLACE

    def _same_view(self, found: Hypothesis, best: Hypothesis, comparison: CellComparison) -> bool:
        """Return whether a keyframe near the best match shows the same view."""
        if found.geometry is None or best.geometry is None:
            return False
        strength, strongest = found.geometry.strength, best.geometry.strength
        if comparison.possible:
            between = comparison.between(found.keyframe_id, best.keyframe_id)
            if between >= self.settings.same_view and strength >= _HALF * strongest:
                return True
        preferred = comparison.of(found.keyframe_id) >= comparison.of(best.keyframe_id)
        beside = self._database.distance(found.keyframe_id, best.keyframe_id) == 1
        return beside and preferred and strength >= self.settings.nearly_as_strong * strongest

    def _with_path(
        self,
        ranked: list[Hypothesis],
        path: PathMatch | None,
        result: SearchResult,
        min_score: float,
    ) -> list[Hypothesis]:
        """
        Put the keyframe of the path first, unless keypoints accept another place.

        Of what keypoints accept at the place of the path, only keyframes next to it remain.
        """
        if path is None or path.probability < min_score:
            return ranked
        accepted = [found for found in ranked if found.score >= min_score]
        match = result.find(path.keyframe_id)
        if match is None or any(
            self._distinct(found.keyframe_id, path.keyframe_id) for found in accepted
        ):
            return ranked
        evidence = self._scorer.unverified_evidence(match, result.background.count)
        known = next((found for found in ranked if found.match == match), None)
        best = replace(known or Hypothesis(match, None, evidence), score=path.probability)
        rest = [found for found in ranked if found.match != match]
        near = self._database.near(path.keyframe_id, _NEXT_TO_PATH)
        return [best] + [
            found
            if found.keyframe_id in near or found.score < min_score
            else replace(found, score=min(found.score, _HALF), reason=Reason.ANOTHER_PLACE)
            for found in rest
        ]

    def _candidate(
        self, found: Hypothesis, query: Query, camera: Camera | None, min_score: float
    ) -> Candidate:
        geometry = found.geometry
        shift_x, shift_y = self._offsets[found.match.shift].tolist()
        if geometry is not None and geometry.inliers:
            shift_x, shift_y = geometry.shift_x, geometry.shift_y
        accepted = found.score >= min_score
        return Candidate(
            query_stamp_ns=query.stamp_ns,
            match_stamp_ns=self._database.get(found.keyframe_id).stamp_ns,
            match_id=found.keyframe_id,
            similarity=found.match.similarity,
            score=found.score,
            inliers=NOT_VERIFIED if geometry is None else round(geometry.strength),
            accepted=accepted,
            reason=Reason.ACCEPTED if accepted else found.reason,
            shift_x=float(np.float32(shift_x)),
            shift_y=float(np.float32(shift_y)),
            rotation=_rotation(found, query, camera) if accepted else None,
        )


@dataclass
class _ImageVerification:
    """
    Verifies matches of one image, each once.

    :param query: the image.
    :param result: what the database found.
    :param database: of the keyframes.
    :param settings: the numbers that decide.
    """

    query: Query
    result: SearchResult
    database: KeyframeDatabase
    settings: VerificationSettings
    matches: dict[int, Match] = field(default_factory=dict)
    geometries: dict[int, Geometry] = field(default_factory=dict)
    comparison: CellComparison = field(init=False)

    def __post_init__(self) -> None:
        self.comparison = CellComparison(self.query, self.database)

    @property
    def certain(self) -> bool:
        """Return whether a match is beyond doubt, so that no rival can make it ambiguous."""
        settings = self.settings
        return any(
            found.strength >= settings.certain_inliers and found.spread >= settings.full_spread
            for found in self.geometries.values()
        )

    @property
    def strongest(self) -> int:
        """Return the id of the match with the strongest geometry."""
        return max(self.geometries, key=lambda found: self.geometries[found].strength)

    def strongest_near(self, keyframe_id: int) -> Match:
        """Return the strongest match of the place of a keyframe."""
        near = [
            found
            for found in self.matches
            if (apart := self.database.distance(found, keyframe_id)) is not None
            and apart <= self.settings.elsewhere
        ]
        return self.matches[max(near, key=lambda found: self.geometries[found].strength)]

    def verify(self, keyframe_ids: Iterable[int]) -> None:
        """Verify keyframes that were searched and are not verified yet."""
        for keyframe_id in keyframe_ids:
            match = self.result.find(keyframe_id)
            if match is not None and keyframe_id not in self.matches:
                self.matches[keyframe_id] = match
                self.geometries[keyframe_id] = self._geometry(keyframe_id)

    def _geometry(self, keyframe_id: int) -> Geometry:
        query, keyframe = self.query.keypoints, self.database.get(keyframe_id)
        if query is None or keyframe.keypoints is None:
            return Geometry()

        def is_static(points: NDArray[np.float32]) -> bool:
            cells = self.comparison.cells
            if cells is None or keyframe.cells is None:
                return False
            agreement = agreement_elsewhere(cells, keyframe.cells.unpack(), points)
            return agreement < self.settings.still_agreement

        return verify_geometry(query, keyframe.keypoints, self.query.static, is_static)


def _rotation(found: Hypothesis, query: Query, camera: Camera | None) -> Quaternion | None:
    """Return how the camera has turned since the keyframe, None if that is not known."""
    geometry, keypoints = found.geometry, query.keypoints
    if camera is None or geometry is None or keypoints is None:
        return None
    return relative_rotation(camera, geometry.pairs) if camera.fits(keypoints.aspect) else None
