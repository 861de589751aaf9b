# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Candidates as sensor_msgs/PointCloud2, in both directions.

An ament_python package cannot define messages; a point cloud is a table with named and typed
columns that C++ and Python read with their standard iterators and RViz shows as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hdc_place_recognition.camera import Quaternion
from hdc_place_recognition.results import Candidate, Reason
from hdc_place_recognition.ros.keyframe_positions import Position
import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

_NS = 1_000_000_000
_FORMATS = {
    'x': 'f4',
    'y': 'f4',
    'z': 'f4',
    'query_sec': 'i4',
    'query_nanosec': 'u4',
    'match_sec': 'i4',
    'match_nanosec': 'u4',
    'match_id': 'u4',
    'similarity': 'f4',
    'score': 'f4',
    'inliers': 'i4',
    'accepted': 'u1',
    'shift_x': 'f4',
    'shift_y': 'f4',
    'reason': 'u1',
    'qx': 'f4',
    'qy': 'f4',
    'qz': 'f4',
    'qw': 'f4',
}
_DATATYPES = {
    'f4': PointField.FLOAT32,
    'i4': PointField.INT32,
    'u4': PointField.UINT32,
    'u1': PointField.UINT8,
}
# Of the field reason: 0 for accepted, and so on in the order of the enumeration.
REASONS = tuple(Reason)
_UNKNOWN: Quaternion = (float('nan'),) * 4
# Fields of four bytes on their boundaries, also from one point to the next.
CANDIDATE_DTYPE = np.dtype(
    {
        'names': list(_FORMATS),
        'formats': ['<' + kind for kind in _FORMATS.values()],
        'offsets': [4 * index for index in range(len(_FORMATS))],
        'itemsize': 4 * len(_FORMATS),
    }
)


@dataclass(frozen=True)
class PublishedCandidate:
    """A candidate, and where the robot was at the match: metres, NaN where not known."""

    candidate: Candidate
    position: Position


def candidates_message(header: Header, published: Sequence[PublishedCandidate]) -> PointCloud2:
    """
    Return one point a candidate, in the order given; width 0 where there is none.

    :param header: of the query image.
    """
    table = np.array([_row(item) for item in published], CANDIDATE_DTYPE)
    return PointCloud2(
        header=header,
        height=1,
        width=len(table),
        is_bigendian=False,
        is_dense=False,
        fields=[
            PointField(name=name, offset=4 * index, datatype=_DATATYPES[kind], count=1)
            for index, (name, kind) in enumerate(_FORMATS.items())
        ],
        point_step=table.itemsize,
        row_step=table.nbytes,
        data=table.tobytes(),
    )


def read_table(message: PointCloud2) -> NDArray[np.void]:
    """
    Return the message's points as a structured array with the columns that it names.

    :return: (width,) array, a view of the message's data.
    """
    kinds = {number: kind for kind, number in _DATATYPES.items()}
    order = '>' if message.is_bigendian else '<'
    dtype = np.dtype(
        {
            'names': [field.name for field in message.fields],
            'formats': [order + kinds[field.datatype] for field in message.fields],
            'offsets': [field.offset for field in message.fields],
            'itemsize': message.point_step,
        }
    )
    return np.frombuffer(message.data, dtype, count=message.width * message.height)


def read_candidates(message: PointCloud2) -> list[PublishedCandidate]:
    """Return what :func:`candidates_message` was made from; similarities are float32 exact."""
    return [
        PublishedCandidate(
            Candidate(
                query_stamp_ns=int(row['query_sec']) * _NS + int(row['query_nanosec']),
                match_stamp_ns=int(row['match_sec']) * _NS + int(row['match_nanosec']),
                match_id=int(row['match_id']),
                similarity=float(row['similarity']),
                score=float(row['score']),
                inliers=int(row['inliers']),
                accepted=bool(row['accepted']),
                reason=REASONS[row['reason']],
                shift_x=float(row['shift_x']),
                shift_y=float(row['shift_y']),
                rotation=_rotation(row),
            ),
            (float(row['x']), float(row['y']), float(row['z'])),
        )
        for row in read_table(message)
    ]


def _row(published: PublishedCandidate) -> tuple[float, ...]:
    candidate = published.candidate
    return (
        *published.position,
        *divmod(candidate.query_stamp_ns, _NS),
        *divmod(candidate.match_stamp_ns, _NS),
        candidate.match_id,
        candidate.similarity,
        candidate.score,
        candidate.inliers,
        candidate.accepted,
        candidate.shift_x,
        candidate.shift_y,
        REASONS.index(candidate.reason),
        *(candidate.rotation or _UNKNOWN),
    )


def _rotation(row: NDArray[np.void]) -> Quaternion | None:
    """Return the rotation of a point of the cloud, None where it is not known."""
    x, y, z, w = (float(row[name]) for name in ('qx', 'qy', 'qz', 'qw'))
    return None if np.isnan(w) else (x, y, z, w)
