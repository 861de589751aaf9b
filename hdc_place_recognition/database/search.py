# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Similarities of a query to all keyframes: exact, or exact only for those that the signs put first.

The centered cosine (paper, Sec. 3.1.4) under means m of queries and mu of keyframes is
(q - m)(x - mu) / |q - m| |x - mu|, with (q - m)(x - mu) = (q - m) x - (q - m) mu and
|x - mu|^2 = |x|^2 - 2 x mu + |mu|^2. So one pass over the vectors as they are stored is enough,
with mu as one more probe.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from hdc_place_recognition.database import sign_index
from hdc_place_recognition.database.vector_store import SlotOrder, VectorStore
from hdc_place_recognition.hdc import algebra
from hdc_place_recognition.hdc.algebra import Hypervector
import numpy as np
from numpy.typing import NDArray

# Squared lengths below this are rounding errors of centering.
_ROUNDING = 1e-9
# Rows that are compared exactly. On 10,000 rows made of real images the best row is among the 300
# that the signs put first for all of 81 shifted queries, and 99 % of the ten best.
_NEAREST = 512
# Above _ALL_SIGNS rows, only those that the coarse signs put first are compared by all signs: this
# share, and at least _LEAST. Of real best matches with a cosine of .25 to .3, 17 % are not in the
# first 16th and 2 % not in the first quarter; above .3 it is 1 % and none.
_ALL_SIGNS, _SHARE, _LEAST = 32768, 16, 16384
# Evenly spaced rows that are compared exactly, as a sample of the distribution.
_SPACED = 128
# The rows before and after this many best ones are compared exactly too.
_BEST = 16


@dataclass(frozen=True)
class Similarities:
    """
    The similarities of a query to the rows that were searched.

    :param values: (n,) float32, -1 to 1, each under the best shift. A row that was not compared
        exactly has an estimate from its signs, which is never above that of the nearest rows.
    :param shifts: (n,) uint8, index of the best shift; the zero shift for rows that were not
        compared exactly.
    :param sample: (b,) float32, exact values with the distribution of all rows.
    """

    values: NDArray[np.float32]
    shifts: NDArray[np.uint8]
    sample: NDArray[np.float32]


@dataclass(frozen=True)
class CenteredQuery:
    """
    A query and the means that are subtracted before it is compared.

    :param vectors: (s, d) float32, the image descriptor under each shift.
    :param means: (s, d) float64, the mean of all queries under each shift.
    """

    vectors: Hypervector
    means: NDArray[np.float64]

    @property
    def zero_shift(self) -> int:
        """Return the index of the zero shift, and of the mean of the keyframes."""
        return len(self.vectors) // 2

    @cached_property
    def centered(self) -> NDArray[np.float64]:
        """Return (s, d), the descriptors without their means."""
        return self.vectors - self.means

    def probes(self) -> Hypervector:
        """Return (s + 1, d) float32: the centered descriptors and the mean of the keyframes."""
        mean = self.means[self.zero_shift][None]
        return np.concatenate([self.centered, mean]).astype(np.float32)

    def cosines(
        self, products: NDArray[np.float32], squares: NDArray[np.float64]
    ) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        """
        Return the centered cosine of each row under its best shift, and the index of that shift.

        The cosine is 0 where the query or the row has no direction.

        :param products: (n, s + 1), products of the rows with :meth:`probes`.
        :param squares: (n,), squared lengths of the rows.
        """
        mean = self.means[self.zero_shift]
        along_mean = (self.centered @ mean).astype(np.float32)
        above = products[:, :-1] - along_mean
        above *= _inverse_lengths(np.square(self.centered).sum(axis=1))
        # The length of a row does not change which shift fits it best.
        best = above.argmax(axis=1)
        similarities = np.take_along_axis(above, best[:, None], axis=1)[:, 0]
        similarities *= _inverse_lengths(squares - 2 * products[:, -1] + mean @ mean)
        return np.clip(similarities, -1, 1, out=similarities), best.astype(np.uint8)


def _inverse_lengths(squares: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return 1 / length of vectors, 0 where there is no direction."""
    lengths = np.sqrt(np.where(squares > _ROUNDING, squares, np.inf))
    return (1 / lengths).astype(np.float32)


def search_all(
    store: VectorStore, order: SlotOrder, count: int, query: CenteredQuery
) -> Similarities:
    """
    Compare a query with all rows.

    :param order: the slots of the rows.
    :param count: number of rows to search: the first ones.
    """
    slots = order.slots_to_read(count)
    products = order.in_order(store.products(query.probes(), slots).T, count).T
    squares = order.in_order(store.squares(slots), count)
    values, shifts = query.cosines(products, squares)
    return Similarities(values, shifts, values)


def search_in_two_stages(
    store: VectorStore,
    order: SlotOrder,
    count: int,
    query: CenteredQuery,
    groups: tuple[tuple[int, ...], ...],
    also: NDArray[np.intp],
) -> Similarities:
    """
    Compare a query with the rows whose signs are nearest to its own.

    The signs are compared with bundles of neighboring shifts. A bundle is similar to each of its
    members (Sec. 3.1.3), so that a few of them stand for all shifts.

    :param order: the slots of the rows.
    :param count: number of rows to search: the first ones.
    :param groups: indices of the shifts that are bundled.
    :param also: rows that are compared exactly too.
    """
    near, values = _nearest_by_signs(store, order, count, query, groups)
    shifts = np.full(count, query.zero_shift, np.uint8)
    probes = query.probes()

    def compare(rows: NDArray[np.intp]) -> None:
        vectors, squares = store.gather(order.slots(rows))
        values[rows], shifts[rows] = query.cosines(vectors @ probes.T, squares)

    spaced = np.linspace(0, count - 1, min(_SPACED, count)).astype(np.intp)
    compared = np.union1d(np.union1d(near, spaced), also)
    compare(compared)
    best = near[np.argsort(-values[near], kind='stable')[:_BEST]]
    beside = np.clip(np.union1d(best - 1, best + 1), 0, count - 1)
    beside = np.setdiff1d(beside, compared)
    compare(beside)
    compared = np.union1d(compared, beside)
    exact = values[compared]
    np.minimum(values, values[near].min(), out=values)
    values[compared] = exact
    return Similarities(values, shifts, values[spaced])


def _nearest_by_signs(
    store: VectorStore,
    order: SlotOrder,
    count: int,
    query: CenteredQuery,
    groups: tuple[tuple[int, ...], ...],
) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """Return the rows to compare exactly, rising, and estimates (count,) of all similarities."""
    centered = algebra.normalize(query.centered.astype(np.float32))
    bundles = np.stack([algebra.bundle(centered[list(group)]) for group in groups])
    queries = sign_index.signs(bundles, np.zeros(store.dimensions, np.float32))
    coarse = order.in_order(store.signs.coarse(queries, order.slots_to_read(count)), count)
    least = coarse.min(axis=0)
    if count > _ALL_SIGNS:
        chosen = sign_index.nearest(least, max(count // _SHARE, _LEAST))
    else:
        chosen = np.arange(count)
    slots = order.slots(chosen)
    by_slot = np.argsort(slots)
    distances = np.empty((len(queries), len(chosen)), np.uint32)
    distances[:, by_slot] = store.signs.fine(queries, slots[by_slot])
    distances += coarse[:, chosen]
    nearest_query = distances.min(axis=0)
    estimates = sign_index.cosines(least, min(store.signs.coarse_dimensions, store.dimensions))
    estimates[chosen] = sign_index.cosines(nearest_query, store.dimensions)
    return chosen[sign_index.nearest(nearest_query, _NEAREST)], estimates
