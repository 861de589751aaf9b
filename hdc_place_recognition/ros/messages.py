# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Candidates as sensor_msgs/PointCloud2, in both directions.

An ament_python package cannot define messages. A point cloud is a table with named and typed
columns, which C++ and Python read with standard iterators and RViz shows as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hdc_place_recognition.results import Candidate, CANDIDATE_FIELDS, candidate_from
from hdc_place_recognition.ros.keyframe_positions import Position
import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

_POSITION = ('x', 'y', 'z')
_TYPES = {
    **dict.fromkeys(_POSITION, 'f4'),
    **{column.name: column.dtype for column in CANDIDATE_FIELDS},
}
_DATATYPES = {
    'f4': PointField.FLOAT32,
    'i4': PointField.INT32,
    'u4': PointField.UINT32,
    'u1': PointField.UINT8,
}
# Each field begins on a boundary of four bytes, also from one point to the next.
CANDIDATE_DTYPE = np.dtype(
    {
        'names': list(_TYPES),
        'formats': ['<' + dtype for dtype in _TYPES.values()],
        'offsets': [4 * index for index in range(len(_TYPES))],
        'itemsize': 4 * len(_TYPES),
    }
)


@dataclass(frozen=True)
class PublishedCandidate:
    """
    A candidate as it is published.

    :param candidate: as the recognizer found it.
    :param position: of the robot at the match, meters; NaN if it is not known.
    """

    candidate: Candidate
    position: Position


def candidates_message(header: Header, published: Sequence[PublishedCandidate]) -> PointCloud2:
    """
    Return a message with one point a candidate, in the given order; width 0 for none.

    :param header: of the query image.
    """
    rows = [
        (*found.position, *(column.get(found.candidate) for column in CANDIDATE_FIELDS))
        for found in published
    ]
    table = np.array(rows, CANDIDATE_DTYPE)
    return PointCloud2(
        header=header,
        height=1,
        width=len(table),
        is_bigendian=False,
        is_dense=False,
        fields=[
            PointField(name=name, offset=4 * index, datatype=_DATATYPES[dtype], count=1)
            for index, (name, dtype) in enumerate(_TYPES.items())
        ],
        point_step=table.itemsize,
        row_step=table.nbytes,
        data=table.tobytes(),
    )


def read_table(message: PointCloud2) -> NDArray[np.void]:
    """
    Return the points of a message as a structured array with the columns that it names.

    :return: (width,) array, a view of the message's data.
    """
    dtypes = {number: dtype for dtype, number in _DATATYPES.items()}
    order = '>' if message.is_bigendian else '<'
    dtype = np.dtype(
        {
            'names': [column.name for column in message.fields],
            'formats': [order + dtypes[column.datatype] for column in message.fields],
            'offsets': [column.offset for column in message.fields],
            'itemsize': message.point_step,
        }
    )
    return np.frombuffer(message.data, dtype, count=message.width * message.height)


def read_candidates(message: PointCloud2) -> list[PublishedCandidate]:
    """Return the candidates of a message of :func:`candidates_message`; values are float32."""
    return [PublishedCandidate(candidate_from(row), _position(row)) for row in read_table(message)]


def _position(row: NDArray[np.void]) -> Position:
    return float(row['x']), float(row['y']), float(row['z'])
