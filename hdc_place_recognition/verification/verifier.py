# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Which candidates are loop closures: verification of the matches that the database found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from hdc_place_recognition.camera import Camera, Quaternion
from hdc_place_recognition.database.base import KeyframeDatabase, Match, Query, SearchResult
from hdc_place_recognition.features.compact import KEYPOINT_WIDTH, quantize
from hdc_place_recognition.features.local_features import LocalFeatures
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.results import Candidate, NOT_VERIFIED, Reason
from hdc_place_recognition.verification.geometry import Geometry, verify_geometry
from hdc_place_recognition.verification.rotation import relative_rotation
from hdc_place_recognition.verification.scoring import Evidence, Scorer
from hdc_place_recognition.verification.temporal import TemporalSupport
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Hypothesis:
    """
    A match that may be the place of the query.

    :param match: found by the database.
    :param evidence: for it.
    :param score: probability of a true closure; 0 if it was not verified.
    :param other_place: whether the score is low because another place fits better.
    """

    match: Match
    evidence: Evidence
    score: float = 0.0
    other_place: bool = False


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

    def verify(
        self,
        query: Query,
        result: SearchResult,
        temporal: TemporalSupport,
        camera: Camera | None,
        params: Params,
    ) -> tuple[Candidate, ...]:
        """
        Return the candidates of an image, best first, accepted or not.

        :param query: the image.
        :param result: what the database found for it.
        :param temporal: the matches of the images before it; takes in its best one.
        :param camera: that took the image, None if it is not calibrated.
        :param params: read are top_k, verify_top_k and min_score.
        """
        if not result.matches:
            return ()
        image = _VerifiedImage(query, result, self._database, self._scorer, temporal)
        verified = len(result.matches) if query.keypoints is None else params.verify_top_k
        hypotheses = [image.hypothesis(match) for match in result.matches[:verified]]
        if query.keypoints is not None:
            hypotheses += [image.hypothesis(match) for match in image.next_to(hypotheses)]
        best = strongest(hypotheses)
        if query.moved and query.keypoints is not None:
            temporal.remember(best.match.keyframe_id, self._certainty(hypotheses, best))
        ranked = self._rank(hypotheses, best)
        ranked += [image.unverified(match) for match in result.matches[verified:]]
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
        verify_geometry(keypoints, keypoints, self.settings)

    def _certainty(self, hypotheses: Sequence[Hypothesis], best: Hypothesis) -> float:
        """Return the strength of the best match, less what its lead over a rival lacks."""
        strength, clear = best.evidence.strength, self.settings.clear_lead
        leads = [
            strength - rival.evidence.strength
            for rival in hypotheses
            if self._apart(rival, best) > self.settings.elsewhere
        ]
        return strength - max(clear - min(leads, default=clear), 0.0)

    def _rank(self, hypotheses: Sequence[Hypothesis], best: Hypothesis) -> list[Hypothesis]:
        """
        Return the hypotheses with their scores, best first.

        An image shows one place: another place is true only as far as the best one is not. A
        strong second place is the same scene from elsewhere, and a closure there would bend the
        map.
        """
        most = self._scorer.probability(best.evidence)
        scored = []
        for found in hypotheses:
            own = self._scorer.probability(found.evidence)
            score = own if self._same_place(found, best) else min(own, 1 - most)
            scored.append(replace(found, score=score, other_place=score < own))
        return sorted(scored, key=lambda found: (-found.score, -found.match.similarity))

    def _same_place(self, found: Hypothesis, best: Hypothesis) -> bool:
        """Return whether a match is the best one, or next to it and nearly as strong."""
        if found.match.keyframe_id == best.match.keyframe_id:
            return True
        geometry, strongest_one = found.evidence.geometry, best.evidence.geometry
        if geometry is None or strongest_one is None or self._apart(found, best) > 1:
            return False
        return geometry.strength >= self.settings.equal_neighbor * strongest_one.strength

    def _apart(self, first: Hypothesis, second: Hypothesis) -> float:
        """Return how many keyframes two matches are apart; infinite across traverses."""
        apart = self._database.distance(first.match.keyframe_id, second.match.keyframe_id)
        return np.inf if apart is None else apart

    def _candidate(
        self, found: Hypothesis, query: Query, camera: Camera | None, min_score: float
    ) -> Candidate:
        geometry = found.evidence.geometry
        shift_x, shift_y = self._offsets[found.match.shift].tolist()
        if geometry is not None and geometry.votes:
            shift_x, shift_y = geometry.shift_x, geometry.shift_y
        accepted = found.score >= min_score
        return Candidate(
            query_stamp_ns=query.stamp_ns,
            match_stamp_ns=self._database.get(found.match.keyframe_id).stamp_ns,
            match_id=found.match.keyframe_id,
            similarity=found.match.similarity,
            score=found.score,
            inliers=NOT_VERIFIED if geometry is None else geometry.inliers,
            accepted=accepted,
            reason=Reason.ACCEPTED if accepted else _reason(found, query),
            shift_x=float(np.float32(shift_x)),
            shift_y=float(np.float32(shift_y)),
            rotation=_rotation(found, query, camera) if accepted else None,
        )


@dataclass(frozen=True)
class _VerifiedImage:
    """Collects the evidence for matches of one image."""

    query: Query
    result: SearchResult
    database: KeyframeDatabase
    scorer: Scorer
    temporal: TemporalSupport

    def hypothesis(self, match: Match) -> Hypothesis:
        """Return a match with the evidence of similarity, time and geometry."""
        query, keyframe = self.query.keypoints, self.database.get(match.keyframe_id).keypoints
        if query is None or keyframe is None:
            return self.unverified(match)
        return self._with(match, verify_geometry(query, keyframe, self.scorer.settings))

    def unverified(self, match: Match) -> Hypothesis:
        """Return a match with the evidence of similarity and time."""
        return self._with(match, None)

    def next_to(self, hypotheses: Sequence[Hypothesis]) -> list[Match]:
        """Return the neighbors of the strongest match that were not verified yet."""
        known = {found.match.keyframe_id for found in hypotheses}
        near = self.database.neighbors(strongest(hypotheses).match.keyframe_id)
        others = self.result.others
        return [others[found] for found in near if found in others and found not in known]

    def _with(self, match: Match, geometry: Geometry | None) -> Hypothesis:
        support = self.temporal.of(match.keyframe_id, self.query.moved, self.database.distance)
        evidence = self.scorer.evidence(
            match.similarity,
            self.result.background,
            geometry,
            at_edge=match.at_edge,
            support=support,
        )
        return Hypothesis(match, evidence)


def strongest(hypotheses: Sequence[Hypothesis]) -> Hypothesis:
    """Return the hypothesis with most evidence."""
    return max(hypotheses, key=lambda found: found.evidence.total)


def _reason(found: Hypothesis, query: Query) -> Reason:
    """Return why a candidate is not accepted."""
    if found.other_place:
        return Reason.ANOTHER_PLACE
    if found.evidence.geometry is None and query.keypoints is not None:
        return Reason.NOT_VERIFIED
    return found.evidence.reason


def _rotation(found: Hypothesis, query: Query, camera: Camera | None) -> Quaternion | None:
    """Return how the camera has turned since the keyframe, None if that is not known."""
    geometry, keypoints = found.evidence.geometry, query.keypoints
    if camera is None or geometry is None or keypoints is None:
        return None
    return relative_rotation(camera, geometry.pairs) if camera.fits(keypoints.aspect) else None
