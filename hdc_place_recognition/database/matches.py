# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The matches of one search: the best rows, and what else is asked about a row."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from hdc_place_recognition.database.base import ELSEWHERE, Match, PLACE_RADIUS
from hdc_place_recognition.database.entries import Entries
from hdc_place_recognition.database.search import Similarities
import numpy as np
from numpy.typing import NDArray

# The view has been left where a keyframe is less distinct than this share of the match.
_SAME_VISIT_SHARE = 0.5
# The oldest keyframes matter only if these are many.
_MANY = 8
# More rows than can be near to one: a rival is among them.
_RIVALS = 2 * ELSEWHERE + 2


@dataclass
class Matches:
    """
    The rows that were compared with a query.

    :param entries: of the database.
    :param similarities: of the vectors.
    :param distinctness: (n,) float32, of vector and words together.
    :param traverse: number of the query's traverse.
    :param excluded: row that is no match, None if all are.
    """

    entries: Entries
    similarities: Similarities
    distinctness: NDArray[np.float32]
    traverse: int
    excluded: int | None

    def best(self, values: NDArray[np.float32], k: int) -> tuple[Match, ...]:
        """
        Return the matches of the k highest values, at most one for each place.

        :param values: (n,) float32; of equal ones the older row comes first.
        """
        left = values.astype(np.float32, copy=True)
        if self.excluded is not None and self.excluded < len(left):
            left[self.excluded] = -np.inf
        rows: list[int] = []
        while len(rows) < min(k, len(left)):
            row = int(np.argmax(left))
            if left[row] == -np.inf:
                break
            rows.append(row)
            near = self.entries.rows_near(row, PLACE_RADIUS)
            left[[row, *(index for index in near if index < len(left))]] = -np.inf
        return tuple(self._match(row) for row in rows)

    def find(self, keyframe_id: int) -> Match | None:
        """Return the match of a keyframe, None if it was not searched."""
        row = self.entries.row(keyframe_id)
        if row is None or row >= len(self.distinctness) or row == self.excluded:
            return None
        return self._match(row)

    def _match(self, row: int) -> Match:
        rival = self._rival(row)
        return Match(
            keyframe_id=self.entries.ids[row],
            similarity=float(self.similarities.values[row]),
            shift=int(self.similarities.shifts[row]),
            distinctness=float(self.distinctness[row]),
            rival_id=None if rival is None else self.entries.ids[rival],
            rival_distinctness=0.0 if rival is None else float(self.distinctness[rival]),
            same_visit=self._same_visit(row),
            oldest=self.entries.oldest(row) and len(self.distinctness) >= _MANY,
        )

    @cached_property
    def _most_distinct(self) -> list[int]:
        """Return the most distinct rows, best first, of equal ones the older first."""
        values = self.distinctness
        rows = np.arange(len(values))
        if len(values) > _RIVALS + 1:
            rows = np.sort(np.argpartition(-values, _RIVALS)[: _RIVALS + 1])
        order = np.argsort(-values[rows], kind='stable')
        return [int(row) for row in rows[order] if row != self.excluded]

    def _rival(self, row: int) -> int | None:
        """Return the most distinct row of another place."""
        near = {row, *self.entries.rows_near(row, ELSEWHERE)}
        return next((rival for rival in self._most_distinct if rival not in near), None)

    def _same_visit(self, row: int) -> bool:
        if self.entries.traverses[row] != self.traverse:
            return False
        since = self.entries.rows_of(self.traverse, row, len(self.distinctness))
        least = float(self.distinctness[since].min())
        return least >= _SAME_VISIT_SHARE * float(self.distinctness[row])
