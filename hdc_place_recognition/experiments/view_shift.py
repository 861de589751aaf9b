# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The experiment on viewpoint: the displacement that fits best against shifts measured by hand."""

from __future__ import annotations

import argparse
import csv
from dataclasses import dataclass
from pathlib import Path

from hdc_place_recognition.datasets.dataset import Dataset, Frames, Mode
from hdc_place_recognition.datasets.open_dataset import open_dataset, Options
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.hdc.shifts import Shifts
from hdc_place_recognition.params.formats import add_arguments, from_arguments
from hdc_place_recognition.recognition.factory import create_recognizer, use_threads
from hdc_place_recognition.recognition.recognizer import PlaceRecognizer
from hdc_place_recognition.results import Frame
import numpy as np
from numpy.typing import NDArray

# Of displacements.csv: pixels at this image width, right and down.
WIDTH_PX = 640
COLUMNS = ('dx_px_640', 'dy_px_640')


@dataclass(frozen=True)
class MeasuredShifts:
    """
    Shift of each query against the reference image of the same place.

    :param measured: (n, 2) by hand, x to the right as a share of the width, y down of the height.
    :param estimated: (n, 2) the same from the displacement under which the pair is most similar.
    """

    measured: NDArray[np.float64]
    estimated: NDArray[np.float64]


def add_shift(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the experiment `shift` to a command."""
    parser = subparsers.add_parser(
        'shift',
        allow_abbrev=False,
        help='compare estimated with measured shifts of the view',
        description='Compare the displacement under which true pairs are most similar with shifts '
        'that were measured by hand.',
    )
    parser.add_argument(
        'input',
        type=Path,
        metavar='FOLDER',
        help='images/ref, images/query and displacements.csv, with equal numbers for equal places',
    )
    add_arguments(parser)
    parser.set_defaults(run=run_shift)


def run_shift(arguments: argparse.Namespace) -> str:
    """
    Run the experiment and return its table.

    :raises PlaceRecognitionError: input or a parameter is bad.
    """
    measured = read_displacements(arguments.input / 'displacements.csv')
    dataset = open_dataset(arguments.input, None, Options())
    params = from_arguments(arguments).replace(**dataset.overrides)
    if params.displacements_x == params.displacements_y == 1:
        raise PlaceRecognitionError(
            'displacements_x and displacements_y are 1: a shift is estimated by displacements'
        )
    use_threads(params)
    return table(dataset.name, estimate(dataset, measured, create_recognizer(params)))


def read_displacements(file: Path) -> dict[int, tuple[float, float]]:
    """
    Return the measured shifts of a displacements.csv by number of the place.

    :param file: csv with the columns index (of the image in both traverses), dx_px_640 and
        dy_px_640 (pixels right and down, of the query against the reference).
    :raises PlaceRecognitionError: no such file, a column is missing, a value is not a finite
        number, a place is there twice, or there is none.
    """
    if not file.is_file():
        raise PlaceRecognitionError(f'{file} does not exist; it holds the measured shifts')
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
                    f'{file}, line {number}: {error!r}; every line needs another index and '
                    f'numbers in the columns {", ".join(COLUMNS)}'
                ) from error
            found[index] = x, y
    if len(found) < 2:
        raise PlaceRecognitionError(f'{file} has {len(found)} shifts; two or more are needed')
    return found


def estimate(
    dataset: Dataset, measured: dict[int, tuple[float, float]], recognizer: PlaceRecognizer
) -> MeasuredShifts:
    """
    Estimate the shifts of the places that were measured.

    :param dataset: two traverses with the same places in the same order.
    :param measured: pixels at an image width of 640, by number of the place.
    :param recognizer: with an empty database.
    :raises PlaceRecognitionError: there are not two traverses, a place is not among them, or
        nothing is seen in the images.
    """
    if dataset.mode is not Mode.TRAVERSES or dataset.reference is None:
        raise PlaceRecognitionError(f'{dataset.name}: needs images/ref and images/query')
    last = min(len(dataset.queries), len(dataset.reference)) - 1
    if not (min(measured) >= 0 and max(measured) <= last):
        raise PlaceRecognitionError(
            f'{dataset.name}: displacements.csv has places {min(measured)} to {max(measured)}, '
            f'the images are 0 to {last}'
        )
    ids = _store(dataset.reference, recognizer)
    recognizer.start_traverse()
    params = recognizer.params
    offsets = Shifts(
        params.displacements_x, params.displacements_y, params.displacement_step
    ).offsets
    shares, shifts = [], []
    for index, (stamp_ns, image) in enumerate(dataset.queries):
        query = recognizer.observe(Frame(stamp_ns, image)).query
        true_id = ids[index] if index < len(ids) else None
        if index in measured and true_id is not None and not query.empty:
            found = recognizer.database.search(query, 0, also=[true_id], exact=True)
            # Shifted back over the reference: the shift of the view is the opposite.
            shifts.append(-offsets[found.others[true_id].shift])
            shares.append(np.multiply(measured[index], (1, image.shape[1] / image.shape[0])))
    if len(shifts) < 2:
        raise PlaceRecognitionError(
            f'{dataset.name}: {len(shifts)} places show features in both traverses; '
            'two or more are needed'
        )
    return MeasuredShifts(np.array(shares) / WIDTH_PX, np.array(shifts, np.float64))


def table(name: str, shifts: MeasuredShifts) -> str:
    """Return correlation and errors of both axes as lines for people."""
    lines = [
        f'{name}: {len(shifts.measured)} true pairs; shift = position in the query less position '
        'in the reference, right and down positive',
        'axis        correlation  median error  within .1  measured',
    ]
    for axis, label, of in ((0, 'horizontal', 'width'), (1, 'vertical', 'height')):
        measured, estimated = shifts.measured[:, axis], shifts.estimated[:, axis]
        error = np.abs(estimated - measured)
        varies = measured.std() > 0 and estimated.std() > 0
        correlation = f'{np.corrcoef(measured, estimated)[0, 1]:.3f}' if varies else '-'
        lines.append(
            f'{label:10}  {correlation:11}  {np.median(error):<12.3f}  '
            f'{np.mean(error < 0.1):<9.0%}  '
            f'{measured.min():.3f} to {measured.max():.3f} of the {of}'
        )
    return '\n'.join(lines)


def _store(reference: Frames, recognizer: PlaceRecognizer) -> list[int | None]:
    """Return the ids under which the images were stored."""
    observed = (recognizer.observe(Frame(stamp_ns, image)) for stamp_ns, image in reference)
    return [recognizer.store(observation).keyframe_id for observation in observed]
