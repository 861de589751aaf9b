# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The means that centring (Sec. 3.1.4) subtracts, of the images seen so far."""

from __future__ import annotations

from hdc_place_recognition.database.vector_store import Rows
from hdc_place_recognition.hdc.algebra import Hypervector
import numpy as np
from numpy.typing import NDArray


class Means:
    """
    The mean of all queries so far under each displacement; 0 before the first.

    :param forms: s, of a query.
    :param dimensions: d.
    """

    def __init__(self, forms: int, dimensions: int) -> None:
        self._sums = np.zeros((forms, dimensions))
        self.seen = 0

    def see(self, query: Hypervector) -> None:
        """Take in the forms (s, d) of an image."""
        self._sums += query
        self.seen += 1

    def of_forms(self) -> NDArray[np.float64]:
        """Return (s, d)."""
        return self._sums / max(self.seen, 1)

    def sum_of_rows(self) -> NDArray[np.float64]:
        """Return (d,), the sum of the middle forms."""
        return self._sums[len(self._sums) // 2].copy()

    def of_rows(self) -> NDArray[np.float32]:
        """Return (d,), that of the middle forms."""
        total, share = self._sums[len(self._sums) // 2], 1 / max(self.seen, 1)
        return np.multiply(total, share, dtype=np.float32, casting='same_kind')


# Of elements that are about 0.01: the sum has not changed, or by the query alone.
_SAME = 1e-9


class MeanProducts:
    """
    Keeps of each row its product with the sum of the queries seen so far.

    A query that was just seen changes these by its own products with the rows, which are asked
    for anyway: where a query has one form, a second pass is needed for new rows only.

    :param rows: that are compared.
    :param means: of the queries.
    """

    def __init__(self, rows: Rows, means: Means) -> None:
        self._rows, self._means = rows, means
        self._known = np.empty(0)
        self._sum = means.sum_of_rows()

    def forget(self, place: int) -> None:
        """Forget the products of a place, and of all behind it: one of them moves there."""
        self._known = self._known[:place]

    def products(self, query: Hypervector, count: int) -> NDArray[np.float32]:
        """
        Return products of the first places with a centred query and with the mean of rows.

        :param query: (1, d) float32, not centred.
        :return: (count, 2) float32.
        """
        products = self._bring_up_to_date(query, count)
        with_mean = (self._known / max(self._means.seen, 1)).astype(np.float32)
        return np.stack([products - with_mean, with_mean], axis=1)

    def _bring_up_to_date(self, query: Hypervector, count: int) -> NDArray[np.float32]:
        """Make the first places known, and return their products (count,) with a query."""
        total = self._means.sum_of_rows()
        change, self._sum = total - self._sum, total
        known = self._known[:count]
        if _nothing(change) or _nothing(change - query):
            products = self._rows.products(query, count)[:, 0]
            changed = products if not _nothing(change) else np.zeros_like(products)
        else:
            probes = np.concatenate([query, change[None].astype(np.float32)])
            products, changed = self._rows.products(probes, count).T
        new = self._rows.products(total[None].astype(np.float32), count, first=len(known))[:, 0]
        self._known = np.concatenate([known + changed[slice(len(known))], new])
        return products


def _nothing(vector: NDArray[np.float64]) -> bool:
    return float(np.abs(vector).max()) < _SAME
