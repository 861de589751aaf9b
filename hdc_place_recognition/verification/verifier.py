# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Which rows are worth a closer look."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from hdc_place_recognition.camera import Camera, Quaternion, rotation
from hdc_place_recognition.database.memory import Database
from hdc_place_recognition.database.search import Answer
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.results import Candidate, Description, NOT_VERIFIED, Reason
from hdc_place_recognition.verification import scoring
from hdc_place_recognition.verification.geometry import verify
from hdc_place_recognition.verification.scoring import (
    at_edge,
    Distinctness,
    Evidence,
    LEAST_DISTINCTNESS,
    LEAST_INLIERS,
    LEAST_SPREAD,
)
from hdc_place_recognition.verification.temporal import Consistency
import numpy as np
from numpy.typing import NDArray

# Rows this near to a better one show the same place.
_RADIUS = 3


def propose(similarities: NDArray[np.float32], count: int, skip_id: int | None) -> list[int]:
    """
    Return the rows of the highest similarities, best first; of equals the older first.

    Of rows near to each other in time only the best is taken.

    :param similarities: (n,).
    :param count: rows at most.
    :param skip_id: a row that is none.
    """
    left = similarities.astype(np.float32, copy=True)
    if skip_id is not None and skip_id < len(left):
        left[skip_id] = -np.inf
    rows: list[int] = []
    while len(rows) < min(count, len(left)):
        row = int(np.argmax(left))
        if left[row] == -np.inf:
            break
        rows.append(row)
        near = slice(max(row - _RADIUS, 0), row + _RADIUS + 1)
        left[near] = -np.inf
    return rows


def neighbours(row: int, rows: int) -> list[int]:
    """Return the rows before and after one, of those there are."""
    return [near for near in (row - 1, row + 1) if 0 <= near < rows]


# A neighbour of the best row is as good if its geometry is nearly as strong.
_AS_GOOD = 0.7
# Rows further than this from the best may be another place, and rivals if they are nearly as
# strong: such an image is of a place with look-alikes, and supports the next ones less.
_ELSEWHERE_ROWS = 10
_CLEAR_LEAD = 0.7


@dataclass(frozen=True)
class Hypothesis:
    """
    A row that an image may be the place of.

    :param evidence: what is known of it.
    :param score: the probability that it is a true closure; 0 where it was not asked for.
    :param elsewhere: whether the score is low because another place is better.
    """

    row: int
    evidence: Evidence
    score: float = 0.0
    elsewhere: bool = False


def best_of(looked: Iterable[Hypothesis]) -> Hypothesis:
    """Return the row with most evidence."""
    return max(looked, key=lambda each: each.evidence.total)


def certainty(looked: Iterable[Hypothesis], best: Hypothesis) -> float:
    """Return the strength of the best row, less what its lead over a rival elsewhere lacks."""
    strength = best.evidence.strength
    leads = [
        strength - each.evidence.strength
        for each in looked
        if abs(each.row - best.row) > _ELSEWHERE_ROWS
    ]
    return strength - max(_CLEAR_LEAD - min(leads, default=_CLEAR_LEAD), 0.0)


def rank(looked: Iterable[Hypothesis], best: Hypothesis) -> list[Hypothesis]:
    """
    Return rows with their scores, best first.

    An image shows one place: another one can be true only as far as the best is not. A strong
    second place is the same scene from elsewhere, and a closure there would bend the map.
    """
    most = _probability(best.evidence)
    scored = []
    for each in looked:
        own = _probability(each.evidence)
        elsewhere = not _same_place(each, best)
        score = min(own, 1 - most) if elsewhere else own
        scored.append(Hypothesis(each.row, each.evidence, score, elsewhere and score < own))
    return sorted(scored, key=lambda each: (-each.score, -each.evidence.similarity))


def _probability(evidence: Evidence) -> float:
    verified = evidence.geometry is not None
    table = scoring.VERIFIED if verified else scoring.UNVERIFIED
    return table.score(evidence.total)


def _same_place(looked: Hypothesis, best: Hypothesis) -> bool:
    """Return whether a row is the best one, or next to it and nearly as good."""
    if looked.row == best.row:
        return True
    geometry, strongest = looked.evidence.geometry, best.evidence.geometry
    if geometry is None or strongest is None or abs(looked.row - best.row) > 1:
        return False
    return geometry.strength >= _AS_GOOD * strongest.strength


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
