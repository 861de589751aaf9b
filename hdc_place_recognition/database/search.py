# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
How similar rows are to a query: exactly, or exactly only where signs say it may matter.

The centred cosine (Sec. 3.1.4) under means m of queries and mu of rows has
(q - m)(x - mu) = (q - m) x - (q - m) mu above, and |x - mu|^2 = |x|^2 - 2 x mu + |mu|^2 below: one
pass over the rows as they are, with mu as one more query (or none: :class:`MeanProducts`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from hdc_place_recognition.database import sign_index
from hdc_place_recognition.database.centering import MeanProducts
from hdc_place_recognition.database.vector_store import Order, Rows
from hdc_place_recognition.hdc import algebra
import numpy as np
from numpy.typing import NDArray

# Squared lengths below this are rounding errors of centring, not directions.
_NOTHING = 1e-9
# Rows that signs put first; the best row is among 300 in all of 81 displaced queries to 10,000
# rows made of real images, the best ten to 99 %.
_NEAREST = 512
# Of more rows, those that the first part of the signs puts first are looked at with all signs:
# this share, and at least so many. Of real best matches of a cosine of .25 to .3, 17 % are not in
# the first 16th, 2 % not in the first quarter; of those above .3, 1 % and none.
_ALL_SIGNS, _SHARE, _LEAST = 32768, 16, 16384
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
    :param displacements: (n,) uint8, which one that is; that by nothing where not compared.
    :param background: (b,) float32, similarities that are distributed as those of all rows.
    """

    similarities: NDArray[np.float32]
    displacements: NDArray[np.uint8]
    background: NDArray[np.float32]


@dataclass(frozen=True)
class Question:
    """
    A query, and what is subtracted before it is compared.

    :param query: (s, d) float32, its forms; the middle one is displaced by nothing.
    :param means: (s, d) float64.
    """

    query: algebra.Hypervector
    means: NDArray[np.float64]

    @property
    def middle(self) -> int:
        """Return the index of the form displaced by nothing, and of the mean of the rows."""
        return len(self.query) // 2

    @cached_property
    def centred(self) -> NDArray[np.float64]:
        """Return (s, d), the forms without their means."""
        return self.query - self.means

    def cosines(
        self, products: NDArray[np.float32], squares: NDArray[np.float64]
    ) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        """
        Return the best centred cosine of each row and its form; 0 where there is no direction.

        :param products: (n, s + 1), of the rows with :meth:`probes`.
        :param squares: (n,), of the rows' lengths.
        """
        mean = self.means[self.middle]
        along_mean = (self.centred @ mean).astype(np.float32)
        above = products[:, :-1] - along_mean
        above *= _inverse_lengths(np.square(self.centred).sum(axis=1))
        # A row's own length does not change which of the forms fits it best.
        best = above.argmax(axis=1)
        similarities = np.take_along_axis(above, best[:, None], axis=1)[:, 0]
        similarities *= _inverse_lengths(squares - 2 * products[:, -1] + mean @ mean)
        return np.clip(similarities, -1, 1, out=similarities), best.astype(np.uint8)

    def probes(self) -> algebra.Hypervector:
        """Return (s + 1, d) float32: the centred forms and the mean of the rows."""
        return np.concatenate([self.centred, self.means[self.middle][None]]).astype(np.float32)


def _inverse_lengths(squares: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return 1 / length of vectors, 0 where there is no direction."""
    lengths = np.sqrt(np.where(squares > _NOTHING, squares, np.inf))
    return (1 / lengths).astype(np.float32)


def search_all(
    rows: Rows, products: MeanProducts, order: Order, count: int, question: Question
) -> Answer:
    """
    Compare a query with all rows.

    :param products: of the rows, for a query of one form.
    :param order: where they are.
    :param count: the first rows that are asked for.
    """
    extent = order.extent(count)
    if len(question.query) == 1:
        found = products.products(question.query, extent)
    else:
        found = rows.products(question.probes(), extent)
    found = order.in_order(found.T, count).T
    squares = order.in_order(rows.squares(extent), count)
    similarities, displacements = question.cosines(found, squares)
    return Answer(similarities, displacements, similarities)


def search_in_two_stages(
    rows: Rows,
    order: Order,
    count: int,
    question: Question,
    groups: tuple[tuple[int, ...], ...],
) -> Answer:
    """
    Compare a query with those rows whose signs are nearest to it.

    Signs are compared with bundles of neighbouring forms: a bundle is similar to each of its
    parts, so that a few of them stand for all displacements.

    :param order: where the rows are.
    :param count: the first rows that are asked for.
    :param groups: indices of the forms that are bundled.
    """
    near, similarities = _nearest_by_signs(rows, order, count, question, groups)
    displacements = np.full(count, question.middle, np.uint8)
    probes = question.probes()

    def compare(chosen: NDArray[np.intp]) -> None:
        vectors, squares = rows.gather(order.places(chosen))
        answer = question.cosines(vectors @ probes.T, squares)
        similarities[chosen], displacements[chosen] = answer

    spaced = np.linspace(0, count - 1, min(_SPACED, count)).astype(np.intp)
    compared = np.union1d(near, spaced)
    compare(compared)
    best = near[np.argsort(-similarities[near], kind='stable')[:_BEST]]
    beside = np.clip(np.union1d(best - 1, best + 1), 0, count - 1)
    beside = np.setdiff1d(beside, compared)
    compare(beside)
    compared = np.union1d(compared, beside)
    exact = similarities[compared]
    np.minimum(similarities, similarities[near].min(), out=similarities)
    similarities[compared] = exact
    return Answer(similarities, displacements, similarities[spaced])


def _nearest_by_signs(
    rows: Rows,
    order: Order,
    count: int,
    question: Question,
    groups: tuple[tuple[int, ...], ...],
) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """Return the rows to be compared, rising, and estimates (count,) of all similarities."""
    centred = algebra.normalize(question.centred.astype(np.float32))
    bundles = np.stack([centred[list(group)].sum(axis=0) for group in groups])
    queries = sign_index.signs(bundles, np.zeros(rows.dimensions, np.float32))
    coarse = order.in_order(rows.signs.coarse(queries, order.extent(count)), count)
    least = coarse.min(axis=0)
    if count > _ALL_SIGNS:
        chosen = sign_index.nearest(least, max(count // _SHARE, _LEAST))
    else:
        chosen = np.arange(count)
    places = order.places(chosen)
    by_place = np.argsort(places)
    distances = np.empty((len(queries), len(chosen)), np.uint32)
    distances[:, by_place] = rows.signs.fine(queries, places[by_place])
    distances += coarse[:, chosen]
    nearest_query = distances.min(axis=0)
    similarities = sign_index.cosines(least, min(rows.signs.coarse_dimensions, rows.dimensions))
    similarities[chosen] = sign_index.cosines(nearest_query, rows.dimensions)
    return chosen[sign_index.nearest(nearest_query, _NEAREST)], similarities
