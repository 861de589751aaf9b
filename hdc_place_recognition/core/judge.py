# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Which candidates are loop closures: similarity proposes, geometry and time dispose."""

from __future__ import annotations

from dataclasses import dataclass

from hdc_place_recognition.camera import Camera, Quaternion, rotation
from hdc_place_recognition.core.consistency import Consistency
from hdc_place_recognition.core.database import Database
from hdc_place_recognition.core.detection import Candidate, Description, NOT_VERIFIED, Reason
from hdc_place_recognition.core.evidence import (
    at_edge,
    Distinctness,
    Evidence,
    LEAST_DISTINCTNESS,
    LEAST_INLIERS,
    LEAST_SPREAD,
)
from hdc_place_recognition.core.hypotheses import best_of, certainty, Hypothesis, rank
from hdc_place_recognition.core.proposals import neighbours, propose
from hdc_place_recognition.core.search import Answer
from hdc_place_recognition.core.verification import verify
from hdc_place_recognition.params.table import Params
import numpy as np
from numpy.typing import NDArray


class Judge:
    """
    Decides on the candidates of one image after the other.

    :param offsets: (s, 2) float32, the displacements that images are compared under.
    :ivar camera: that took the images, None if it is not calibrated.
    """

    def __init__(self, offsets: NDArray[np.float32]) -> None:
        self.consistency = Consistency()
        self.camera: Camera | None = None
        self._offsets = offsets

    def candidates(
        self,
        description: Description,
        answer: Answer,
        database: Database,
        params: Params,
        skip_row: int | None,
    ) -> tuple[Candidate, ...]:
        """
        Return the candidates of an image, best first, those accepted and others.

        :param answer: how similar the rows are that may be candidates.
        :param skip_row: one that may not.
        """
        count = max(params.top_k, params.verify_top_k)
        rows = propose(answer.similarities, count, skip_row)
        if not rows:
            return ()
        distinctness = Distinctness(answer.background)
        look = _Look(description, answer, database, self.consistency, distinctness)
        verified = rows if description.landmarks is None else rows[: params.verify_top_k]
        looked = [look.at(row) for row in verified]
        if description.landmarks is not None:
            near = neighbours(best_of(looked).row, len(answer.similarities))
            looked += [look.at(row) for row in near if row not in (*verified, skip_row)]
        best = best_of(looked)
        if description.moved and description.landmarks is not None:
            self.consistency.remember(best.row, certainty(looked, best))
        others = [row for row in rows if row not in verified]
        judged = rank(looked, best)
        judged += [Hypothesis(row, look.evidence(row)) for row in others]
        return tuple(
            self._candidate(each, description, answer, database, params)
            for each in judged[: params.top_k]
        )

    def _candidate(
        self,
        looked: Hypothesis,
        description: Description,
        answer: Answer,
        database: Database,
        params: Params,
    ) -> Candidate:
        geometry = looked.evidence.geometry
        shift_x, shift_y = self._offsets[answer.displacements[looked.row]].tolist()
        if geometry is not None and geometry.votes:
            shift_x, shift_y = geometry.shift_x, geometry.shift_y
        accepted = looked.score >= params.min_score
        return Candidate(
            query_stamp_ns=description.stamp_ns,
            match_stamp_ns=database.stamps_ns[looked.row],
            match_id=database.ids[looked.row],
            similarity=looked.evidence.similarity,
            score=looked.score,
            inliers=NOT_VERIFIED if geometry is None else geometry.inliers,
            accepted=accepted,
            reason=Reason.ACCEPTED if accepted else _reason(looked, description),
            shift_x=float(np.float32(shift_x)),
            shift_y=float(np.float32(shift_y)),
            rotation=self._rotation(looked, description) if accepted else None,
        )

    def _rotation(self, looked: Hypothesis, description: Description) -> Quaternion | None:
        """Return how the camera has turned since the earlier image, None if that is not known."""
        camera, landmarks = self.camera, description.landmarks
        geometry = looked.evidence.geometry
        if camera is None or geometry is None or landmarks is None:
            return None
        return rotation(camera, geometry.pairs) if camera.took(landmarks.aspect) else None


@dataclass(frozen=True)
class _Look:
    """Collects what is known of rows, seen from one image."""

    description: Description
    answer: Answer
    database: Database
    consistency: Consistency
    distinctness: Distinctness

    def at(self, row: int) -> Hypothesis:
        """Return the row with all that can be known."""
        return Hypothesis(row, self.evidence(row, verified=True))

    def evidence(self, row: int, *, verified: bool = False) -> Evidence:
        """Return what similarity and time say of a row and, if wanted, geometry."""
        similarities = self.answer.similarities
        query, earlier = self.description.landmarks, self.database.landmarks[row]
        geometry = None
        if verified and query is not None and earlier is not None:
            geometry = verify(query, earlier)
        return Evidence(
            similarity=float(similarities[row]),
            distinctness=self.distinctness.of(float(similarities[row])),
            at_edge=at_edge(row, len(similarities)),
            support=self.consistency.support(row, self.description.moved),
            geometry=geometry,
        )


def _reason(looked: Hypothesis, description: Description) -> Reason:
    """Return the first of the reasons why a row is not accepted."""
    evidence, geometry = looked.evidence, looked.evidence.geometry
    if looked.elsewhere:
        return Reason.ANOTHER_PLACE
    if geometry is None and description.landmarks is not None:
        return Reason.NOT_VERIFIED
    reasons = {
        Reason.FEW_INLIERS: geometry and min(geometry.votes, geometry.inliers) < LEAST_INLIERS,
        Reason.NO_SPREAD: geometry and geometry.spread < LEAST_SPREAD,
        Reason.LIKE_MANY: evidence.distinctness < LEAST_DISTINCTNESS,
        Reason.AT_EDGE: geometry and evidence.at_edge,
        Reason.NO_SUPPORT: geometry and not evidence.support,
    }
    return next((reason for reason, holds in reasons.items() if holds), Reason.UNLIKELY)
