# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The experiment `hdc_experiments shift`: estimated against manually measured image shifts."""

from __future__ import annotations

import argparse
import csv
from dataclasses import dataclass
from pathlib import Path

from hdc_place_recognition.datasets.dataset import Dataset, Frames, Mode
from hdc_place_recognition.datasets.open_dataset import open_dataset
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.hdc.shifts import Shifts
from hdc_place_recognition.params.formats import add_arguments, from_arguments
from hdc_place_recognition.recognition.factory import create_recognizer, limited_threads
from hdc_place_recognition.recognition.recognizer import PlaceRecognizer
import numpy as np
from numpy.typing import NDArray

# Columns of displacements.csv: pixels right and down at this image width.
WIDTH_PX = 640
COLUMNS = ('dx_px_640', 'dy_px_640')


@dataclass(frozen=True)
class MeasuredShifts:
    """
    Shift of each query relative to the reference image of the same place.

    :param measured: (n, 2) measured manually; x to the right as a share of the width, y down as a
        share of the height.
    :param estimated: (n, 2) in the same units, the shift at which the pair is most similar.
    """

    measured: NDArray[np.float64]
    estimated: NDArray[np.float64]


def add_shift(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the subcommand `shift`."""
    parser = subparsers.add_parser(
        'shift',
        allow_abbrev=False,
        help='compare estimated and measured image shifts',
        description='Compare the shift at which images of the same place are most similar with '
        'shifts that were measured manually.',
    )
    parser.add_argument(
        'input',
        type=Path,
        metavar='FOLDER',
        help='folder with images/ref, images/query and displacements.csv; image n of both '
        'traverses shows place n',
    )
    add_arguments(parser)
    parser.set_defaults(run=run_shift)


def run_shift(arguments: argparse.Namespace) -> str:
    """
    Run the experiment and return its table.

    :raises PlaceRecognitionError: an input or a parameter is invalid.
    """
    measured = read_displacements(arguments.input / 'displacements.csv')
    dataset = open_dataset(arguments.input)
    params = from_arguments(arguments).replace(**dataset.overrides)
    if params.displacements_x == params.displacements_y == 1:
        raise PlaceRecognitionError(
            'displacements_x and displacements_y are 1: the shift is estimated by displacements; '
            'increase one of them'
        )
    with limited_threads(params):
        return table(dataset.name, estimate(dataset, measured, create_recognizer(params)))


def read_displacements(file: Path) -> dict[int, tuple[float, float]]:
    """
    Read the measured shifts (x, y) of displacements.csv by place number.

    :param file: csv file with the columns index (image number in both traverses), dx_px_640 and
        dy_px_640 (shift of the query relative to the reference, pixels right and down).
    :raises PlaceRecognitionError: the file or a column is missing, a value is not a finite
        number, a place is listed twice, or there are fewer than two places.
    """
    if not file.is_file():
        raise PlaceRecognitionError(f'{file} does not exist; it must list the measured shifts')
    found: dict[int, tuple[float, float]] = {}
    with file.open(newline='', encoding='utf-8') as stream:
        for number, row in enumerate(csv.DictReader(stream), start=2):
            try:
                index = int(row['index'])
                x, y = (float(row[column]) for column in COLUMNS)
                if index in found or not np.isfinite([x, y]).all():
                    raise ValueError('a place given twice, or no finite number')
            except (KeyError, TypeError, ValueError, csv.Error) as error:
                raise PlaceRecognitionError(
                    f'{file}, line {number}: {error!r}; every line needs a unique index and '
                    f'numbers in the columns {", ".join(COLUMNS)}'
                ) from error
            found[index] = x, y
    if len(found) < 2:
        raise PlaceRecognitionError(f'{file} has {len(found)} shifts; at least two are needed')
    return found


def estimate(
    dataset: Dataset, measured: dict[int, tuple[float, float]], recognizer: PlaceRecognizer
) -> MeasuredShifts:
    """
    Estimate the shifts of the measured places.

    :param dataset: two traverses; image n of both shows place n.
    :param measured: shift in pixels at an image width of 640, by place number.
    :param recognizer: recognizer with an empty database.
    :raises PlaceRecognitionError: there are not two traverses, a place is missing, or fewer than
        two places have features in both traverses.
    """
    reference = _checked_reference(dataset, measured)
    keyframe_ids = _store(reference, recognizer)
    recognizer.start_traverse()
    params = recognizer.params
    offsets = Shifts(
        params.displacements_x, params.displacements_y, params.displacement_step
    ).offsets
    shares, shifts = [], []
    for place, frame in enumerate(dataset.queries):
        query = recognizer.observe(frame).query
        keyframe_id = keyframe_ids[place] if place < len(keyframe_ids) else None
        if place in measured and keyframe_id is not None and not query.empty:
            found = recognizer.database.search(query, 1, exact=True).find(keyframe_id)
            assert found is not None  # it was just stored
            # The offset moves the query back onto the reference, so the sign is opposite.
            shifts.append(-offsets[found.shift])
            height, width = frame.image.shape[:2]
            shares.append(np.multiply(measured[place], (1, width / height)))
    if len(shifts) < 2:
        raise PlaceRecognitionError(
            f'{dataset.name}: {len(shifts)} places have features in both traverses; '
            'at least two are needed'
        )
    return MeasuredShifts(np.array(shares) / WIDTH_PX, np.array(shifts, np.float64))


def _checked_reference(dataset: Dataset, measured: dict[int, tuple[float, float]]) -> Frames:
    """Return the reference images; raise an error if a measured place is not in the dataset."""
    if dataset.mode is not Mode.TRAVERSES or dataset.reference is None:
        raise PlaceRecognitionError(f'{dataset.name}: needs images/ref and images/query')
    last = min(len(dataset.queries), len(dataset.reference)) - 1
    if not (min(measured) >= 0 and max(measured) <= last):
        raise PlaceRecognitionError(
            f'{dataset.name}: displacements.csv has places {min(measured)} to {max(measured)}, '
            f'the images are 0 to {last}'
        )
    return dataset.reference


def table(name: str, shifts: MeasuredShifts) -> str:
    """Return the correlation and the errors of both axes as a text table."""
    lines = [
        f'{name}: {len(shifts.measured)} true pairs; shift = position in the query minus position '
        'in the reference, right and down positive',
        'axis        correlation  median error  within .1  measured',
    ]
    for axis, label, unit in ((0, 'horizontal', 'width'), (1, 'vertical', 'height')):
        measured, estimated = shifts.measured[:, axis], shifts.estimated[:, axis]
        error = np.abs(estimated - measured)
        varies = measured.std() > 0 and estimated.std() > 0
        correlation = f'{np.corrcoef(measured, estimated)[0, 1]:.3f}' if varies else '-'
        lines.append(
            f'{label:10}  {correlation:11}  {np.median(error):<12.3f}  '
            f'{np.mean(error < 0.1):<9.0%}  '
            f'{measured.min():.3f} to {measured.max():.3f} of the {unit}'
        )
    return '\n'.join(lines)


def _store(reference: Frames, recognizer: PlaceRecognizer) -> list[int | None]:
    """Store the reference images; return their keyframe ids, None for images not stored."""
    return [recognizer.store(recognizer.observe(frame)).keyframe_id for frame in reference]
