# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Counts and times of the node, for /diagnostics."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field
import math

from hdc_place_recognition.results import Detection, Reason, SKIPPED, Status

# Weight of the newest image in the running means of milliseconds.
_NEWEST = 0.1
# Seconds that a problem is reported after it was last seen.
_RECENT_S = 10


@dataclass
class Statistics:
    """
    Counts since the start, and the last answer.

    Each count is written by one thread only; a reader may see it a moment late.
    """

    received: int = 0
    dropped: int = 0
    lost_by_dds: int = 0
    processed: int = 0
    failed: int = 0
    unpublished: int = 0
    skipped: Counter[Status] = field(default_factory=Counter)
    accepted: int = 0
    reasons: Counter[Reason] = field(default_factory=Counter)
    last_status: str = 'waiting for the first image'
    last_error: str = ''
    best_similarity: float = math.nan
    milliseconds: dict[str, float] = field(default_factory=dict)

    def note(self, detection: Detection) -> bool:
        """Count an answer; return whether the image was processed, not skipped."""
        if detection.status in SKIPPED:
            self.skipped[detection.status] += 1
            return False
        self.processed += 1
        self.accepted += len(detection.accepted)
        self.last_status = explain(detection)
        if detection.candidates:
            self.reasons[detection.candidates[0].reason] += 1
            self.best_similarity = max(
                *(candidate.similarity for candidate in detection.candidates),
                -1.0 if math.isnan(self.best_similarity) else self.best_similarity,
            )
        for stage, spent in detection.milliseconds.items():
            before = self.milliseconds.get(stage, spent)
            self.milliseconds[stage] = before + _NEWEST * (spent - before)
        return True

    def fail(self, error: str) -> None:
        """Count an image that could not be processed."""
        self.failed += 1
        self.last_error = error

    def values(self) -> dict[str, str]:
        """Return all values as the text of diagnostics."""
        counts = {
            'images received': self.received,
            'images processed': self.processed,
            'images dropped while busy': self.dropped,
            'images lost by DDS': self.lost_by_dds,
            'images refused': self.failed,
            'answers not published': self.unpublished,
            **{f'images {status.value}': self.skipped[status] for status in SKIPPED},
            'loop closures': self.accepted,
            **{f'best candidate {reason.value}': self.reasons[reason] for reason in Reason},
        }
        # A copy, since the worker thread may add a stage at any time.
        stages = {f'ms {name}': f'{spent:.2f}' for name, spent in dict(self.milliseconds).items()}
        return {
            **{name: str(count) for name, count in counts.items()},
            **stages,
            'last status': self.last_status,
            'last error': self.last_error,
            'best similarity so far': f'{self.best_similarity:.3f}',
        }


def explain(detection: Detection) -> str:
    """Return what became of an image and why its best candidate was not accepted."""
    if detection.accepted or not detection.candidates:
        return detection.status.value
    return f'{detection.status.value}: {detection.candidates[0].reason.value}'


class RecentProblems:
    """
    Finds problems with the images of the last seconds by the counts of the node.

    :param statistics: counts since the start; to be read once a second.
    :param loss_remedy: what to do if DDS loses images.
    """

    def __init__(self, statistics: Statistics, loss_remedy: str) -> None:
        self._statistics, self._loss_remedy = statistics, loss_remedy
        self._before = deque([self._counts()], maxlen=_RECENT_S + 1)

    def problem(self) -> str:
        """Return the worst problem of the last seconds, '' if none; call once a second."""
        counts = self._counts()
        recent = Counter({name: counts[name] - self._before[0][name] for name in counts})
        self._before.append(counts)
        return self._unusable(recent) or self._loss(recent) or self._unpublished(recent)

    def _counts(self) -> Counter[str]:
        known = self._statistics
        return Counter(
            received=known.received,
            processed=known.processed,
            refused=known.failed,
            lost=known.lost_by_dds,
            repeated=known.skipped[Status.STAMP_REPEATED],
            late=known.skipped[Status.STAMP_OUT_OF_ORDER],
            unpublished=known.unpublished,
        )

    def _unusable(self, recent: Counter[str]) -> str:
        """Return why no image could be processed."""
        worst = max(('refused', 'repeated', 'late'), key=lambda name: recent[name])
        if recent['processed'] or not recent[worst]:
            return ''
        why = (
            f'{recent[worst]} '
            + {
                'refused': f'were refused: {self._statistics.last_error}',
                'repeated': 'have the same header stamp as the image before: the driver must set '
                'a stamp for each image',
                'late': 'have an older header stamp than the image before: correct the driver',
            }[worst]
        )
        return f'none of the last {recent["received"]} images was processed; {why}'

    def _loss(self, recent: Counter[str]) -> str:
        if not recent['lost']:
            return ''
        return (
            f'DDS has lost {recent["lost"]} of the last {recent["lost"] + recent["received"]} '
            f'images: {self._loss_remedy}'
        )

    def _unpublished(self, recent: Counter[str]) -> str:
        if not recent['unpublished']:
            return ''
        return (
            f'{recent["unpublished"]} of the last {recent["processed"]} answers could not be '
            f'published: {self._statistics.last_error}'
        )
