# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Which candidates are loop closures: similarity proposes, geometry and time dispose."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from hdc_place_recognition.core import calibration
from hdc_place_recognition.core.consistency import Consistency
from hdc_place_recognition.core.database import Answer, Database
from hdc_place_recognition.core.detection import Candidate, Description, NOT_VERIFIED, Reason
from hdc_place_recognition.core.evidence import (
    at_edge,
    distinctness,
    Evidence,
    LEAST_DISTINCTNESS,
    LEAST_INLIERS,
    LEAST_SPREAD,
)
from hdc_place_recognition.core.proposals import neighbours, propose
from hdc_place_recognition.core.verification import verify
from hdc_place_recognition.params import Params
import numpy as np
from numpy.typing import NDArray

# A neighbour of the best row is as good if its geometry is nearly as strong.
_AS_GOOD = 0.7


@dataclass(frozen=True)
class _Looked:
    """A row, what speaks for it, and the probability that it is a true closure."""

    row: int
    evidence: Evidence
    score: float = 0.0
    elsewhere: bool = False


class Judge:
    """
    Decides on the candidates of one image after the other.

    :param offsets: (s, 2) float32, the displacements that images are compared under.
    """

    def __init__(self, offsets: NDArray[np.float32]) -> None:
        self.consistency = Consistency()
        self._offsets = offsets

    def candidates(
        self,
        description: Description,
        answer: Answer,
        database: Database,
        params: Params,
        skip_id: int | None,
    ) -> tuple[Candidate, ...]:
        """
        Return the candidates of an image, best first, those accepted and others.

        :param answer: how similar the rows are that may be candidates.
        :param skip_id: a row that may not.
        """
        count = max(params.top_k, params.verify_top_k)
        rows = propose(answer.similarities, count, skip_id)
        if not rows:
            return ()
        look = _Look(description, answer, database, self.consistency)
        verified = rows if description.landmarks is None else rows[: params.verify_top_k]
        looked = [look.at(row) for row in verified]
        if description.landmarks is not None:
            near = neighbours(_best(looked).row, len(answer.similarities))
            looked += [look.at(row) for row in near if row not in (*verified, skip_id)]
        best = _best(looked)
        if description.moved and description.landmarks is not None:
            self.consistency.remember(best.row, best.evidence.strength)
        judged = _score(looked, best)
        judged += [_Looked(row, look.evidence(row)) for row in rows[len(verified) :]]
        return tuple(
            self._candidate(each, description, answer, database, params)
            for each in judged[: params.top_k]
        )

    def _candidate(
        self,
        looked: _Looked,
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
            match_id=looked.row,
            similarity=looked.evidence.similarity,
            score=looked.score,
            inliers=NOT_VERIFIED if geometry is None else geometry.inliers,
            accepted=accepted,
            reason=Reason.ACCEPTED if accepted else _reason(looked, description),
            shift_x=float(np.float32(shift_x)),
            shift_y=float(np.float32(shift_y)),
        )


@dataclass(frozen=True)
class _Look:
    """Collects what is known of rows, seen from one image."""

    description: Description
    answer: Answer
    database: Database
    consistency: Consistency

    def at(self, row: int) -> _Looked:
        """Return the row with all that can be known."""
        return _Looked(row, self.evidence(row, verified=True))

    def evidence(self, row: int, *, verified: bool = False) -> Evidence:
        """Return what similarity and time say of a row and, if wanted, geometry."""
        similarities = self.answer.similarities
        query, earlier = self.description.landmarks, self.database.landmarks[row]
        geometry = None
        if verified and query is not None and earlier is not None:
            geometry = verify(query, earlier)
        return Evidence(
            similarity=float(similarities[row]),
            distinctness=distinctness(similarities, row),
            at_edge=at_edge(row, len(similarities)),
            support=self.consistency.support(row, self.description.moved),
            geometry=geometry,
        )


def _best(looked: Iterable[_Looked]) -> _Looked:
    return max(looked, key=lambda each: each.evidence.total)


def _score(looked: Iterable[_Looked], best: _Looked) -> list[_Looked]:
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
        scored.append(_Looked(each.row, each.evidence, score, elsewhere and score < own))
    return sorted(scored, key=lambda each: (-each.score, -each.evidence.similarity))


def _probability(evidence: Evidence) -> float:
    verified = evidence.geometry is not None
    table = calibration.VERIFIED if verified else calibration.UNVERIFIED
    return table.score(evidence.total)


def _same_place(looked: _Looked, best: _Looked) -> bool:
    """Return whether a row is the best one, or next to it and nearly as good."""
    if looked.row == best.row:
        return True
    geometry, strongest = looked.evidence.geometry, best.evidence.geometry
    if geometry is None or strongest is None or abs(looked.row - best.row) > 1:
        return False
    return geometry.strength >= _AS_GOOD * strongest.strength


def _reason(looked: _Looked, description: Description) -> Reason:
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
