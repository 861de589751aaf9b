# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What the recogniser says of an image."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from hdc_place_recognition.camera import Quaternion
from hdc_place_recognition.features.compact import Landmarks
from hdc_place_recognition.hdc.algebra import Hypervector
import numpy as np
from numpy.typing import NDArray

NOT_VERIFIED = -1


@dataclass(frozen=True)
class Frame:
    """
    One image and when it was taken.

    :param stamp_ns: header stamp, nanoseconds.
    :param image: (h, w) gray or (h, w, 3) BGR.
    :param camera: name of the camera that took the image.
    """

    stamp_ns: int
    image: NDArray[np.uint8]
    camera: str = 'camera'


class Status(Enum):
    """What became of an image; the value is a phrase for people."""

    ACCEPTED = 'loop closure'
    BELOW_THRESHOLD = 'no candidate reaches min_score'
    DATABASE_TOO_YOUNG = 'no image in the database is old enough'
    NO_FEATURES = 'no local features in the image'
    TOO_SOON = 'passed over: nearer than min_interval_s to the last image'
    STAMP_REPEATED = 'passed over: same stamp as the last image'
    STAMP_OUT_OF_ORDER = 'passed over: older than the last image'


PASSED_OVER = (Status.TOO_SOON, Status.STAMP_REPEATED, Status.STAMP_OUT_OF_ORDER)


class Reason(Enum):
    """Why a candidate was not accepted; the value is a phrase for people."""

    ACCEPTED = 'accepted'
    ANOTHER_PLACE = 'another place fits better'
    NOT_VERIFIED = 'not verified: not among the verify_top_k best'
    FEW_INLIERS = 'few inliers'
    NO_SPREAD = 'inliers without spread'
    LIKE_MANY = 'too similar to many'
    AT_EDGE = 'at the edge of what was searched, where a better one may lie outside'
    NO_SUPPORT = 'no support by the images before'
    UNLIKELY = 'all in all not likely enough'


@dataclass(frozen=True)
class Candidate:
    """
    An earlier image that may show the same place.

    :param similarity: centred cosine, -1 to 1.
    :param score: probability that it is a true loop closure, 0 to 1; 0 if that was not looked at.
    :param inliers: of the geometric verification; NOT_VERIFIED without one.
    :param accepted: whether the score reaches min_score.
    :param reason: why not, if not.
    :param shift_x: how far to the right the scene lies in the earlier image, share of the width.
    :param shift_y: how far down, share of the height.
    :param rotation: of an accepted one, orientation of the camera in the frame of the earlier one
        (x right, y down, z ahead); None where the camera is not known.
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


@dataclass(frozen=True)
class Description:
    """
    An image as the database knows it, with the milliseconds that each stage took.

    :param query: (s, d) float32, the image under each displacement, the middle one being none.
    :param moved: whether it shows something new, rather than what the last keyframe shows.
    :param landmarks: to verify it by, None where nothing is verified.
    """

    stamp_ns: int
    query: Hypervector
    n_features: int
    moved: bool = True
    landmarks: Landmarks | None = None
    milliseconds: Mapping[str, float] = field(default_factory=dict, compare=False)

    @property
    def empty(self) -> bool:
        """Whether nothing was seen that could be recognised."""
        return not self.query.any()


@dataclass(frozen=True)
class Detection:
    """
    The answer to one image.

    :param candidates: best first, accepted or not; none where the status says why.
    :param similarities: (n,) float32, to the first n rows of the database: those old enough. In
        a large database those of rows far below the candidates are estimates, unless the
        parameter `exact` is set.
    :param keyframe_id: the number under which the image was stored, None if it was not. Images
        are counted from 0; the number is the row until images before it are forgotten.
    :param not_stored: why there was no room for it; empty if there was.
    :param forgotten_ids: the numbers of the images that were forgotten for it.
    :param milliseconds: spent in extract, encode, keypoints, query, verify and insert; on several
        threads, how long keypoints are waited for.
    """

    stamp_ns: int
    status: Status
    candidates: tuple[Candidate, ...] = ()
    similarities: NDArray[np.float32] = field(
        default_factory=lambda: np.empty(0, np.float32), compare=False
    )
    keyframe_id: int | None = None
    not_stored: str = ''
    forgotten_ids: tuple[int, ...] = ()
    n_features: int = 0
    milliseconds: Mapping[str, float] = field(default_factory=dict, compare=False)

    @property
    def accepted(self) -> tuple[Candidate, ...]:
        """Return the candidates that are loop closures."""
        return tuple(candidate for candidate in self.candidates if candidate.accepted)


def status_of(description: Description, candidates: tuple[Candidate, ...]) -> Status:
    """Return what became of an image that was compared."""
    if description.empty:
        return Status.NO_FEATURES
    if not candidates:
        return Status.DATABASE_TOO_YOUNG
    accepted = any(candidate.accepted for candidate in candidates)
    return Status.ACCEPTED if accepted else Status.BELOW_THRESHOLD
