# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What goes into the recognizer and what comes out: frames, candidates, detections."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from hdc_place_recognition.camera import Quaternion
import numpy as np
from numpy.typing import NDArray

NOT_VERIFIED = -1
_NS = 1_000_000_000


@dataclass(frozen=True)
class Frame:
    """
    An image with its time.

    :param stamp_ns: header stamp, nanoseconds.
    :param image: (h, w) gray or (h, w, 3) BGR, uint8, uint16 or float32.
    :param camera: name of the camera; each camera has a traverse of its own.
    """

    stamp_ns: int
    image: NDArray[Any]
    camera: str = 'camera'


class Status(Enum):
    """What became of an image; the value is a phrase for people."""

    ACCEPTED = 'loop closure'
    BELOW_THRESHOLD = 'no candidate reaches min_score'
    DATABASE_TOO_YOUNG = 'no keyframe is old enough to be compared with'
    NO_FEATURES = 'the image has no local features'
    TOO_SOON = 'skipped: less than min_interval_s after the last image'
    STAMP_REPEATED = 'skipped: same stamp as the last image'
    STAMP_OUT_OF_ORDER = 'skipped: older than the last image'


SKIPPED = (Status.TOO_SOON, Status.STAMP_REPEATED, Status.STAMP_OUT_OF_ORDER)


class Reason(Enum):
    """Why a candidate was not accepted: the term of the score that cost most."""

    ACCEPTED = 'accepted'
    ANOTHER_PLACE = 'another place fits better'
    NOT_VERIFIED = 'not verified: not among the verify_top_k most similar'
    FEW_INLIERS = 'few matched keypoints agree with one geometry'
    NO_SPREAD = 'the inliers cover a small part of the image'
    LIKE_MANY = 'as similar to many other keyframes'
    AT_EDGE = 'at the edge of the keyframes searched: a better match may lie outside'
    NO_SUPPORT = 'no support by the images before'
    UNLIKELY = 'low similarity'
    SAME_VISIT = 'the view has not been left since'


@dataclass(frozen=True)
class Candidate:
    """
    A keyframe that may show the same place as the query.

    :param query_stamp_ns: header stamp of the query image.
    :param match_stamp_ns: header stamp of the keyframe.
    :param match_id: id of the keyframe.
    :param similarity: centered cosine, -1 to 1.
    :param score: probability that it is a true loop closure, 0 to 1; 0 if it was not verified.
    :param inliers: matched keypoints that agree with one geometry; NOT_VERIFIED without any.
    :param accepted: whether the score reaches min_score.
    :param reason: why it was not accepted.
    :param shift_x: how far to the right the scene lies in the keyframe, share of the width.
    :param shift_y: how far down, share of the height.
    :param rotation: of an accepted candidate, the orientation of the query's camera in the frame
        of the keyframe's camera (x right, y down, z ahead); None without camera_info.
    :param query_session: number of the session of the query image. A session begins when the clock
        is set back; within a session no stamp occurs twice.
    :param match_session: number of the session of the keyframe.
    """

    query_stamp_ns: int
    match_stamp_ns: int
    match_id: int
    similarity: float
    score: float
    inliers: int
    accepted: bool
    reason: Reason
    shift_x: float
    shift_y: float
    rotation: Quaternion | None = None
    query_session: int = 0
    match_session: int = 0


@dataclass(frozen=True)
class CandidateField:
    """
    A field of a candidate in messages and files.

    :param name: in the message and in candidates.csv.
    :param dtype: numpy's code of the type in the message: f4, i4, u4 or u1.
    :param get: returns the value for the message.
    :param doc: what it is, for doc/topics.md.
    :param text: returns the value for candidates.csv; the same as `get` by default.
    :param in_csv: whether candidates.csv has it.
    """

    name: str
    dtype: str
    get: Callable[[Candidate], float]
    doc: str
    text: Callable[[Candidate], object] | None = None
    in_csv: bool = True


def _stamp(name: str, doc: str, get: Callable[[Candidate], int]) -> tuple[CandidateField, ...]:
    """Return a stamp as seconds and nanoseconds; candidates.csv has it as one number."""
    return (
        CandidateField(f'{name}_sec', 'i4', lambda found: get(found) // _NS, doc, in_csv=False),
        CandidateField(
            f'{name}_nanosec', 'u4', lambda found: get(found) % _NS, 'its nanoseconds', None, False
        ),
    )


def _rotation(name: str, index: int, doc: str) -> CandidateField:
    return CandidateField(
        name,
        'f4',
        lambda found: found.rotation[index] if found.rotation else float('nan'),
        doc,
        lambda found: found.rotation[index] if found.rotation else '',
    )


# Their order is that of the message; new fields are appended, so that readers keep working.
CANDIDATE_FIELDS = (
    *_stamp('query', 'stamp of the query image, seconds', lambda found: found.query_stamp_ns),
    *_stamp('match', 'stamp of the keyframe, seconds', lambda found: found.match_stamp_ns),
    CandidateField('match_id', 'u4', lambda found: found.match_id, 'id of the keyframe'),
    CandidateField('similarity', 'f4', lambda found: found.similarity, 'centered cosine, -1 to 1'),
    CandidateField(
        'score', 'f4', lambda found: found.score, 'probability of a loop closure, 0 to 1'
    ),
    CandidateField(
        'inliers',
        'i4',
        lambda found: found.inliers,
        'matched keypoints that agree with one geometry; -1: not verified',
    ),
    CandidateField(
        'accepted',
        'u1',
        lambda found: int(found.accepted),
        '1 for a loop closure: `score` >= `min_score`',
    ),
    CandidateField(
        'shift_x',
        'f4',
        lambda found: found.shift_x,
        'how far to the right the scene lies in the keyframe, share of the width',
    ),
    CandidateField(
        'shift_y', 'f4', lambda found: found.shift_y, 'how far down, share of the height'
    ),
    CandidateField(
        'reason',
        'u1',
        lambda found: tuple(Reason).index(found.reason),
        'why it was not accepted, see below',
        lambda found: found.reason.value,
    ),
    _rotation(
        'qx',
        0,
        'of an accepted candidate, orientation of the query camera in the frame of the keyframe '
        'camera (x right, y down, z ahead); NaN without `camera_info`',
    ),
    _rotation('qy', 1, 'its y'),
    _rotation('qz', 2, 'its z'),
    _rotation('qw', 3, 'its w'),
    CandidateField(
        'query_session',
        'u4',
        lambda found: found.query_session,
        'session of the query image; a session begins when the clock is set back',
    ),
    CandidateField(
        'match_session', 'u4', lambda found: found.match_session, 'session of the keyframe'
    ),
)


def candidate_from(values: Mapping[str, Any]) -> Candidate:
    """Return the candidate whose fields of :data:`CANDIDATE_FIELDS` have these values."""
    rotation = tuple(float(values[name]) for name in ('qx', 'qy', 'qz', 'qw'))
    return Candidate(
        query_stamp_ns=int(values['query_sec']) * _NS + int(values['query_nanosec']),
        match_stamp_ns=int(values['match_sec']) * _NS + int(values['match_nanosec']),
        match_id=int(values['match_id']),
        similarity=float(values['similarity']),
        score=float(values['score']),
        inliers=int(values['inliers']),
        accepted=bool(values['accepted']),
        reason=tuple(Reason)[values['reason']],
        shift_x=float(values['shift_x']),
        shift_y=float(values['shift_y']),
        rotation=None if np.isnan(rotation).any() else rotation,  # type: ignore[arg-type]
        query_session=int(values['query_session']),
        match_session=int(values['match_session']),
    )


@dataclass(frozen=True)
class Detection:
    """
    The answer to one image.

    :param stamp_ns: header stamp of the image.
    :param status: what became of it.
    :param candidates: best first, accepted or not; empty where the status says why.
    :param similarities: (n,) float32, to the n keyframes that were searched, in the order of their
        ids; empty from a database that does not compare with all. In a large database values far
        below the candidates are estimates, unless the parameter `exact` is set.
    :param keyframe_id: id under which the image was stored, None if it was not.
    :param not_stored: why there was no room for it; empty if there was.
    :param evicted_ids: ids of the keyframes that were evicted for it.
    :param n_features: number of local features.
    :param milliseconds: time of the stages extract, encode, keypoints, query, verify and insert;
        with several threads 'keypoints' is the time that they were waited for.
    """

    stamp_ns: int
    status: Status
    candidates: tuple[Candidate, ...] = ()
    similarities: NDArray[np.float32] = field(
        default_factory=lambda: np.empty(0, np.float32), compare=False
    )
    keyframe_id: int | None = None
    not_stored: str = ''
    evicted_ids: tuple[int, ...] = ()
    n_features: int = 0
    milliseconds: Mapping[str, float] = field(default_factory=dict, compare=False)

    @property
    def accepted(self) -> tuple[Candidate, ...]:
        """Return the candidates that are loop closures."""
        return tuple(candidate for candidate in self.candidates if candidate.accepted)
