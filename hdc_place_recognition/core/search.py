# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
How similar rows are to a query: exactly, or exactly only where signs say it may matter.

The centred cosine (Sec. 3.1.4) under means m of queries and mu of rows has
(q - m)(x - mu) = (q - m) x - (q - m) mu above, and |x - mu|^2 = |x|^2 - 2 x mu + |mu|^2 below: one
pass over the rows as they are, with mu as one more query.
"""

from __future__ import annotations

from dataclasses import dataclass

from hdc_place_recognition.core import hdc, signs
from hdc_place_recognition.core.rows import Rows
import numpy as np
from numpy.typing import NDArray

# Squared lengths below this are rounding errors of centring, not directions.
_NOTHING = 1e-9
# Rows that signs put first; the best row is among 300 in all of 81 displaced queries to 10,000
# rows made of real images, the best ten to 99 %.
_NEAREST = 512
# Evenly spaced rows that stand for all.
_SPACED = 128
# The rows before and after these best ones are compared too: a neighbour may fit better.
_BEST = 16


@dataclass(frozen=True)
class Answer:
    """
    How similar the rows are to a query.

    :param similarities: (n,) float32, -1 to 1, each under the best displacement. Those of rows
        that were not compared are estimates from signs, and none is above one that was.
    :param displacements: (n,) intp, which one that is; that by nothing where not compared.
    :param background: (b,) float32, similarities that are distributed as those of all rows.
    """

    similarities: NDArray[np.float32]
    displacements: NDArray[np.intp]
    background: NDArray[np.float32]


@dataclass(frozen=True)
class Question:
    """
    A query, and what is subtracted before it is compared.

    :param query: (s, d) float32, its forms; the middle one is displaced by nothing.
    :param means: (s, d) float64.
    """

    query: hdc.Hypervector
    means: NDArray[np.float64]

    @property
    def middle(self) -> int:
        """Return the index of the form displaced by nothing, and of the mean of the rows."""
        return len(self.query) // 2

    def cosines(
        self, products: NDArray[np.float32], squares: NDArray[np.float64]
    ) -> tuple[NDArray[np.float32], NDArray[np.intp]]:
        """
        Return the best centred cosine of each row and its form; 0 where there is no direction.

        :param products: (n, s + 1), of the rows with :meth:`probes`.
        :param squares: (n,), of the rows' lengths.
        """
        mean, centred = self.means[self.middle], self.query - self.means
        row_square = squares - 2 * products[:, -1] + mean @ mean
        above = products[:, :-1] - centred @ mean
        below = row_square[:, None] * np.square(centred).sum(axis=1)
        cosine = np.divide(
            above,
            np.sqrt(np.maximum(below, _NOTHING)),
            out=np.zeros_like(below),
            where=below > _NOTHING,
        )
        best = cosine.argmax(axis=1)
        similarities = np.take_along_axis(cosine, best[:, None], axis=1)[:, 0]
        return np.clip(similarities, -1, 1).astype(np.float32), best

    def probes(self) -> hdc.Hypervector:
        """Return (s + 1, d) float32: the centred forms and the mean of the rows."""
        centred = self.query - self.means
        return np.concatenate([centred, self.means[self.middle][None]]).astype(np.float32)


def search_all(rows: Rows, places: NDArray[np.intp], question: Question) -> Answer:
    """
    Compare a query with all rows.

    :param places: (n,) of the rows that are asked for, in the order of the answer.
    """
    count = int(places.max()) + 1
    products = rows.products(question.probes(), count)[places]
    similarities, displacements = question.cosines(products, rows.squares(count)[places])
    return Answer(similarities, displacements, similarities)


def search_in_two_stages(
    rows: Rows,
    places: NDArray[np.intp],
    question: Question,
    groups: tuple[tuple[int, ...], ...],
) -> Answer:
    """
    Compare a query with those rows whose signs are nearest to it.

    Signs are compared with bundles of neighbouring forms: a bundle is similar to each of its
    parts, so that a few of them stand for all displacements.

    :param places: (n,) of the rows that are asked for, in the order of the answer.
    :param groups: indices of the forms that are bundled.
    """
    centred = hdc.normalize((question.query - question.means).astype(np.float32))
    bundles = np.stack([centred[list(group)].sum(axis=0) for group in groups])
    zero = np.zeros(rows.dimensions, np.float32)
    queries = signs.signs(bundles, zero)
    distances = rows.distances(queries, int(places.max()) + 1)[places]
    similarities = signs.cosines(distances, rows.dimensions)
    displacements = np.full(len(places), question.middle, np.intp)
    probes = question.probes()

    def compare(chosen: NDArray[np.intp]) -> None:
        vectors, squares = rows.gather(places[chosen])
        answer = question.cosines(vectors @ probes.T, squares)
        similarities[chosen], displacements[chosen] = answer

    spaced = np.linspace(0, len(places) - 1, min(_SPACED, len(places))).astype(np.intp)
    near = nearest(distances, _NEAREST)
    compared = np.union1d(near, spaced)
    compare(compared)
    best = near[np.argsort(-similarities[near], kind='stable')[:_BEST]]
    beside = np.clip(np.union1d(best - 1, best + 1), 0, len(places) - 1)
    beside = np.setdiff1d(beside, compared)
    compare(beside)
    others = np.ones(len(places), np.bool_)
    others[compared] = others[beside] = False
    similarities[others] = np.minimum(similarities[others], similarities[near].min())
    return Answer(similarities, displacements, similarities[spaced])


def nearest(distances: NDArray[np.uint32], count: int) -> NDArray[np.intp]:
    """Return the rows of the least distances in order of their numbers; of equals the first."""
    if len(distances) <= count:
        return np.arange(len(distances))
    # A distance and a row in one number: no two are equal.
    keys = distances.astype(np.int64) * len(distances) + np.arange(len(distances))
    return np.sort(np.argpartition(keys, count)[:count])
