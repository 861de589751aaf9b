# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Path evidence: loop closures without keypoints, from images that follow each other.

Across seasons no keypoint agrees, and one image alone is no proof. But an earlier traverse of the
same route matches row after row, in the same order. This is a Bayes filter over the question
'which keyframe am I at, if any': the forward pass of a hidden Markov model along the keyframes of
earlier sessions, with log odds against 'nowhere on the map' as its state. The evidence of a
keyframe is the similarity D of dense cells (:mod:`cells`), standardized by what D is between
different places (:class:`Background`). Only keyframes that were compared have evidence; all others
count as background, so D is needed for a handful of keyframes an image.

It must be asked about keyframes of another session, or of long ago: within minutes no season
changes, so a true loop has keypoints, and what has none is a look-alike further along the way.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Ids = NDArray[np.int64]
LogOdds = NDArray[np.float64]

# Log odds of a path that there is not; paths below _FORGET cannot come back and are dropped.
_NEVER = -99.0
_FORGET = -12.0
# Tracked paths: from this log odds on the keyframes ahead of them are compared.
_TRACKED = -4.0
# Keyframes this near to each other show the same place; the vector's proposals are as far apart.
_PLACE = 1
# Row of the state: along the map, or against it. Only paths along the map are accepted, since a
# camera that looks ahead sees other views on the way back; those against it are rivals.
_FORWARD, _BACKWARD = 0, 1


@dataclass(frozen=True)
class PathSettings:
    """
    The numbers that path evidence has; none is critical when moved by 30 %.

    :param slope: log likelihood ratio for each deviation of D, for an image that is all new.
    :param center: deviations at which an image says neither yes nor no.
    :param limit: deviations from which more D says no more: one image alone proves nothing.
    :param change: probability that an image enters or leaves the map.
    :param speed: keyframes that a path advances at most from one image to the next.
    :param elsewhere: keyframes further away than this are another place, and rivals.
    """

    slope: float = 0.8
    center: float = 2.5
    limit: float = 5.5
    change: float = 0.03
    speed: int = 2
    elsewhere: int = 10


@dataclass(frozen=True)
class PathMatch:
    """
    Where the path is after an image.

    :param keyframe_id: of the compared keyframes the most similar one, by D.
    :param probability: that the image was taken there.
    :param log_odds: of the best path there against 'nowhere on the map'.
    :param rival: log odds of the best path at another place or in the other direction.
    """

    keyframe_id: int
    probability: float
    log_odds: float
    rival: float


class Background:
    """
    Running mean and deviation of D between images of different places.

    Starts with what all development sets have in common; the map's own pairs soon outweigh it.
    """

    # Stromovka, planetarium, corridor, desk: mean .036 to .104, deviation .013 to .068.
    _MEAN, _DEVIATION, _PAIRS = 0.055, 0.02, 20
    # Pairs that the mean reaches back to; 300 are no better, and slower to follow a new session.
    _MEMORY = 100
    # Of a deviation: keeps a map of few images from claiming certainty.
    _FLOOR = 0.005
    # A random pair may show one place after all: values above this count as this, deviations.
    _OUTLIER = 4.0

    def __init__(self) -> None:
        self._pairs = self._PAIRS
        self._mean = self._MEAN
        self._square = self._MEAN**2 + self._DEVIATION**2

    @property
    def mean(self) -> float:
        """Return the mean D."""
        return self._mean

    @property
    def deviation(self) -> float:
        """Return the deviation of D, never 0."""
        return float(np.sqrt(max(self._square - self._mean**2, 0.0))) + self._FLOOR

    def update(self, similarity: float) -> None:
        """Take in the D of two images that are far apart on the map."""
        similarity = min(similarity, self._mean + self._OUTLIER * self.deviation)
        self._pairs = min(self._pairs + 1, self._MEMORY)
        self._mean += (similarity - self._mean) / self._pairs
        self._square += (similarity**2 - self._square) / self._pairs

    def z(self, similarity: float) -> float:
        """Return by how many deviations D is above the mean."""
        return (similarity - self._mean) / self.deviation


class PathFilter:
    """
    Follows paths along the keyframes of earlier sessions.

    State of one traverse. For each direction and keyframe r, S(r) is the log odds that the camera
    is at r against nowhere on the map. With an image of novelty nu, e = change * nu:

    - leave: S'(r) = S(r) - log(1 + e max exp S) + log(1 - e), which bounds S near -log e;
    - evidence: l(r) = slope * (clip(z(r), 0, limit) - center), z = 0 for keyframes not compared;
    - advance: S(r) = max over k = 1 ... speed of S'(r - k), + nu l(r);
    - stay: S(r) = S'(r) + nu l(r), but in sum a keyframe gives no more than its best l, once;
    - enter, at proposed keyframes: log(change / proposals) + nu l(r).

    The largest of the last three is kept. The maximum stands for the sum over paths, because
    paths one keyframe apart are one path.
    """

    def __init__(self, settings: PathSettings | None = None) -> None:
        self._settings = settings or PathSettings()
        self._ids: Ids = np.empty(0, np.int64)
        self._odds: LogOdds = np.empty((2, 0))
        self._given: LogOdds = np.empty((2, 0))

    def restart(self) -> None:
        """Forget all paths: another traverse begins."""
        self._ids = np.empty(0, np.int64)
        self._odds, self._given = np.empty((2, 0)), np.empty((2, 0))

    def expected(self, ids: Ids, count: int = 2) -> list[int]:
        """
        Return the keyframes to be compared because paths lead there, at most 3 * count.

        :param ids: (n,) int64, rising, the keyframes that may be matched now.
        :param count: paths that are followed, the likeliest first.
        """
        self._follow(ids)
        left = self._odds.max(axis=0, initial=_NEVER)
        rows: list[int] = []
        for _ in range(min(count, len(ids))):
            row = int(left.argmax())
            if left[row] <= _TRACKED:
                break
            ahead = row + (1 if self._odds[_FORWARD, row] >= self._odds[_BACKWARD, row] else -1)
            rows += [near for near in (ahead - 1, ahead, ahead + 1) if near not in rows]
            left[slice(max(row - _PLACE - 1, 0), row + _PLACE + 2)] = _NEVER
        return [int(ids[row]) for row in rows if 0 <= row < len(ids)]

    def push(
        self, ids: Ids, evidence: Mapping[int, float], proposals: Collection[int], novelty: float
    ) -> PathMatch | None:
        """
        Take in an image and return where the path is, None if nothing was compared.

        To be called for images that show something new (keyframes of the query's traverse): an
        image must not confirm itself.

        :param ids: (n,) int64, rising, the keyframes that may be matched: of other sessions, or
            not seen for long. Evicted ones are just missing.
        :param evidence: z(D) of the compared keyframes, by id.
        :param proposals: of these the ones that the hypervector proposed: paths begin there.
        :param novelty: 1 - cosine of the image and the last keyframe, hypervectors; 0 to 1.
        """
        self._follow(ids)
        known = {row: evidence[key] for key, row in self._rows(evidence)}
        if not known:
            return None
        likelihood = self._likelihood(known, len(ids))
        rows = self._active(known)
        starts = np.searchsorted(rows, [row for _, row in self._rows(proposals) if row in known])
        self._advance(rows, likelihood[rows], starts, float(np.clip(novelty, 0, 1)))
        best = max(known, key=lambda row: known[row])
        return self._match(best, int(ids[best]), likelihood[best] > 0)

    def _likelihood(self, evidence: Mapping[int, float], count: int) -> LogOdds:
        """Return (n,) log likelihood ratios of the rows."""
        z = np.zeros(count)
        z[list(evidence)] = list(evidence.values())
        settings = self._settings
        return settings.slope * (np.clip(z, 0, settings.limit) - settings.center)

    def _active(self, evidence: Collection[int]) -> NDArray[np.intp]:
        """
        Return the rows where anything can change, rising: with evidence, or near a path.

        With as many rows beside a path as it can advance, the first rows of a block of neighbors
        hold no path, and so nothing moves from one block to the next.
        """
        alive = np.flatnonzero(self._odds.max(axis=0) > _NEVER)
        steps = np.arange(-self._settings.speed, self._settings.speed + 1)
        near = np.add.outer(alive, steps).ravel()
        near = near[(near >= 0) & (near < self._odds.shape[1])]
        return np.unique(np.concatenate([near, list(evidence)]).astype(np.intp))

    def _advance(
        self,
        rows: NDArray[np.intp],
        likelihood: LogOdds,
        starts: NDArray[np.intp],
        novelty: float,
    ) -> None:
        """
        Move all paths by one image and weigh them by its evidence.

        :param rows: (m,) the active rows.
        :param likelihood: (m,) their log likelihood ratios.
        :param starts: which of them are proposals.
        """
        gain = novelty * likelihood
        change = self._settings.change * novelty
        odds, given = self._odds[:, rows], self._given[:, rows]
        old = odds + np.log1p(-change) - np.log1p(change * np.exp(odds.max(initial=_NEVER)))
        # What a row has given already, its best l at most, it does not give again.
        stay_gain = np.where(gain > 0, np.clip(likelihood - given, 0, gain), gain)
        stay, go = old + stay_gain, _moved(old, self._settings.speed) + gain
        odds = np.maximum(stay, go)
        once = np.broadcast_to(np.maximum(gain, 0), odds.shape)
        given = np.where(stay >= go, given + np.maximum(stay_gain, 0), once)
        if len(starts):
            enter = np.full(len(rows), _NEVER)
            enter[starts] = np.log(self._settings.change / len(starts)) + gain[starts]
            given = np.where(enter > odds, once, given)
            odds = np.maximum(odds, enter)
        odds[odds < _FORGET] = _NEVER
        self._odds[:, rows], self._given[:, rows] = odds, given

    def _match(self, row: int, keyframe_id: int, supported: bool) -> PathMatch:
        """Return the match at the row of the best D, with its rivals."""
        here = slice(max(row - _PLACE, 0), row + _PLACE + 1)
        log_odds = float(self._odds[_FORWARD, here].max())
        far = self._settings.elsewhere
        others = self._odds.copy()
        others[_FORWARD, slice(max(row - far, 0), row + far + 1)] = _NEVER
        rival = float(others.max())
        probability = 1 / (1 + np.exp(-log_odds) + np.exp(rival - log_odds))
        return PathMatch(keyframe_id, float(probability) if supported else 0.0, log_odds, rival)

    def _follow(self, ids: Ids) -> None:
        """Bring the state to the keyframes there are now: added, evicted, or others."""
        if len(ids) == len(self._ids) and np.array_equal(ids, self._ids):
            return
        odds, given = np.full((2, len(ids)), _NEVER), np.zeros((2, len(ids)))
        if len(ids):
            # The path of an evicted keyframe goes on from the one before it.
            alive = np.flatnonzero(self._odds.max(axis=0, initial=_NEVER) > _NEVER)
            rows = np.maximum(np.searchsorted(ids, self._ids[alive], side='right') - 1, 0)
            for direction in (_FORWARD, _BACKWARD):
                np.maximum.at(odds[direction], rows, self._odds[direction, alive])
                np.maximum.at(given[direction], rows, self._given[direction, alive])
        self._ids, self._odds, self._given = ids.copy(), odds, given

    def _rows(self, ids: Iterable[int]) -> list[tuple[int, int]]:
        """Return ids and their rows, of those there are."""
        wanted = [int(keyframe_id) for keyframe_id in ids]
        rows = np.searchsorted(self._ids, wanted)
        return [
            (key, int(row))
            for key, row in zip(wanted, rows, strict=True)
            if row < len(self._ids) and self._ids[row] == key
        ]


def _moved(odds: LogOdds, speed: int) -> LogOdds:
    """Return (2, n) the best log odds 1 to `speed` rows before, in each direction."""
    moved = np.full_like(odds, _NEVER)
    for step in range(1, min(speed, odds.shape[1] - 1) + 1):
        np.maximum(moved[0, step:], odds[0, :-step], out=moved[0, step:])
        np.maximum(moved[1, :-step], odds[1, step:], out=moved[1, :-step])
    return moved
