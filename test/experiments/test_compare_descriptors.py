# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The experiments `vectors` and `shift` on tiny folders."""

import csv

from conftest import CellExtractor, texture
import cv2
from hdc_place_recognition.cli.experiments import main
from hdc_place_recognition.datasets.open_dataset import open_dataset
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.evaluation.evaluate import evaluate
from hdc_place_recognition.experiments import runs
from hdc_place_recognition.experiments.compare_descriptors import (
    DEFAULT,
    half_interval,
    markdown,
    Variant,
    VARIANTS,
)
from hdc_place_recognition.experiments.runs import (
    CachingExtractor,
    load_into_memory,
    Plan,
    run_plan,
    VariantResult,
)
from hdc_place_recognition.experiments.view_shift import (
    estimate,
    MeasuredShifts,
    read_displacements,
    table,
)
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.factory import assemble
import numpy as np
import pytest

PLACES = (0, 1, 2, 3, 0, 1)
FLAGS = ('--extractor', 'gradient_grid', '--image-width', '64', '--dimensions', '256')
SMALL = Params(dimensions=256, displacements_x=3, displacements_y=1)
PAIR = (
    Variant('default', {}, DEFAULT, 'the baseline'),
    Variant('smaller', {'dimensions': 128}, 'dropped', 'a test'),
)


class CountingExtractor(CellExtractor):
    """Counts the extracted images."""

    calls = 0

    def extract(self, image):
        """Return the features."""
        CountingExtractor.calls += 1
        return super().extract(image)


@pytest.fixture
def counted(monkeypatch):
    """Replace the extractor of the experiment; return the arguments it was created with."""
    CountingExtractor.calls = 0
    created = []

    def create(name, *, image_width, max_features, threads):
        created.append((name, image_width, max_features, threads))
        return CountingExtractor()

    monkeypatch.setattr(runs, 'create_extractor', create)
    return created


@pytest.fixture
def loop(tmp_path):
    """Return a folder with a noisy loop over four places and its ground truth."""
    folder = tmp_path / 'loop'
    write(
        folder / 'images',
        [texture(place) // 2 + texture(99 + n) // 8 for n, place in enumerate(PLACES)],
    )
    same = np.equal.outer(PLACES, PLACES)
    np.savez(folder / 'gt.npz', hard=same, soft=same, min_gap=2)
    return folder


def write(folder, images):
    folder.mkdir(parents=True)
    for number, image in enumerate(images):
        cv2.imwrite(str(folder / f'{number:04d}.png'), image)


def plan(folder, variants=PAIR, seeds=(0, 1), base=SMALL):
    return Plan([open_dataset(folder)], variants, seeds, base)


def test_every_variant_changes_the_default():
    settings = [Params().replace(**variant.changes) for variant in VARIANTS]
    assert [variant.name for variant in VARIANTS if not variant.changes] == ['default']
    assert len(set(settings)) == len({variant.name for variant in VARIANTS}) == len(VARIANTS)


def test_confidence_interval_of_students_t():
    # Three values with standard deviation 1: 4.303 / sqrt(3).
    assert half_interval([1.0, 2.0, 3.0]) == pytest.approx(2.484, abs=1e-3)
    assert half_interval([0.5, 0.5]) == 0.0
    assert half_interval([1.0]) is None
    # 32 values with standard deviation 0.508: the last entry of the table is used.
    assert half_interval([0.0, 1.0] * 16) == pytest.approx(2.042 * 0.508 / 32**0.5, rel=1e-3)


def test_table_has_means_and_intervals():
    runs = [
        VariantResult('one', 'default', 0, 0.4, 1.0, 0.1),
        VariantResult('one', 'default', 1, 0.6, 0.5, 0.1),
        VariantResult('two', 'default', 0, 0.8, 0.2, 0.1),
        VariantResult('two', 'default', 1, 0.8, 0.2, 0.1),
    ]
    lines = markdown(runs, PAIR[:1]).splitlines()
    cells = [[cell.strip() for cell in line.strip('|').split('|')] for line in lines]
    assert cells[0] == ['variant', 'changes', 'one', 'two', 'mean AP', 'decision', 'why']
    # 12.706 * deviation / sqrt(2) over the seeds: .4 and .6; means .6 and .7.
    assert cells[2][2:5] == ['0.500 ± 1.271, 0.75', '0.800 ± 0.000, 0.20', '0.650 ± 0.635']
    assert len(lines) == 3


def test_features_are_cached_by_image_content():
    CountingExtractor.calls = 0
    caching, image = CachingExtractor(CountingExtractor()), texture(1)
    first = caching.extract(image)
    assert caching.extract(image.copy()) is first
    assert caching.extract(np.asfortranarray(image)) is first
    assert CountingExtractor.calls == 1
    caching.extract(image.reshape(64, 48))
    caching.extract(texture(2))
    assert CountingExtractor.calls == 3
    assert caching.identity == CellExtractor.identity


def test_features_beyond_the_capacity_are_extracted_again():
    CountingExtractor.calls = 0
    features = CellExtractor().extract(texture(0))
    size = features.keypoints.nbytes + features.descriptors.nbytes
    caching = CachingExtractor(CountingExtractor(), limit_bytes=size)
    for _ in range(3):
        for seed in (0, 1):
            cached = caching.extract(texture(seed))
            expected = CellExtractor().extract(texture(seed)).descriptors
            np.testing.assert_array_equal(cached.descriptors, expected)
    assert CountingExtractor.calls == 1 + 3


def test_images_in_memory_are_the_same(loop):
    dataset = open_dataset(loop)
    loaded = load_into_memory(dataset)
    assert isinstance(loaded.queries, list)
    for frame, copy in zip(dataset.queries, loaded.queries, strict=True):
        assert frame.stamp_ns == copy.stamp_ns
        np.testing.assert_array_equal(frame.image, copy.image)


def test_results_equal_single_evaluations(loop, counted):
    runs = list(run_plan(plan(loop)))
    assert CountingExtractor.calls == len(PLACES)
    assert len(counted) == 1
    assert [(run.variant, run.seed) for run in runs] == [
        ('default', 0),
        ('default', 1),
        ('smaller', 0),
        ('smaller', 1),
    ]
    for run in runs:
        dimensions = {'default': 256, 'smaller': 128}[run.variant]
        params = SMALL.replace(dimensions=dimensions, seed=run.seed)
        dataset = open_dataset(loop)
        params = params.replace(**dataset.overrides)
        ranking = evaluate(dataset, assemble(params, CellExtractor())).scores.ranking
        assert (run.average_precision, run.recall_at_1) == (
            ranking.average_precision,
            ranking.recall_at_1,
        )


def test_one_extractor_per_image_width(loop, counted):
    wide = Variant('wide', {'image_width': 640}, 'dropped', 'a test')
    runs = list(run_plan(plan(loop, (*PAIR, wide))))
    assert [width for _, width, *_ in counted] == [320, 640]
    assert CountingExtractor.calls == 2 * len(PLACES)
    assert len(runs) == 6


def test_ground_truth_without_matches_is_an_error(loop, counted):
    nothing = np.zeros((len(PLACES), len(PLACES)))
    np.savez(loop / 'gt.npz', hard=nothing, soft=nothing, min_gap=2)
    with pytest.raises(PlaceRecognitionError, match='loop: the ground truth has no pair'):
        list(run_plan(plan(loop)))


def test_command_prints_and_writes_the_table(loop, tmp_path, capsys):
    output = tmp_path / 'out'
    command = [
        'vectors',
        str(loop),
        '--seeds',
        '2',
        '--seed',
        '5',
        '--output',
        str(output),
        '--variants',
        'n = (1, 1)',
        'default',
        *FLAGS,
    ]
    assert main(command) == 0
    printed = capsys.readouterr().out
    assert printed == (output / 'vectors.md').read_text()
    rows = [line.split('|')[1].strip() for line in printed.splitlines() if line[:1] == '|']
    assert rows[0] == 'variant' and rows[2:] == ['default', 'n = (1, 1)']
    assert '4 runs' in printed and 'mean of 2 seeds' in printed
    with (output / 'vectors.csv').open(newline='') as stream:
        runs = list(csv.DictReader(stream))
    assert [(run['variant'], run['seed']) for run in runs] == [
        ('default', '5'),
        ('default', '6'),
        ('n = (1, 1)', '5'),
        ('n = (1, 1)', '6'),
    ]
    assert all(0 < float(run['average_precision']) <= 1 for run in runs)
    # Results are not overwritten.
    assert main(command) == 2
    assert 'vectors.csv exists already' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['vectors', '{loop}', '--seeds', '0'], '--seeds 0: must be 1 or more'),
        (['vectors', '{loop}', '{loop}'], 'loop: given twice'),
        (['vectors', '{loop}/../loop', '{loop}'], 'loop: given twice'),
        (['vectors', '{bare}'], 'bare: no gt.npz'),
        (['vectors', '{bare}/nowhere'], 'nowhere does not exist'),
        (['vectors', '{loop}', '--dimensions', '3'], 'parameter dimensions'),
        (['shift', '{loop}'], 'displacements.csv does not exist'),
    ],
)
def test_bad_input_is_one_line(loop, tmp_path, capsys, arguments, message):
    write(tmp_path / 'bare' / 'images', [texture(0)])
    names = {'loop': loop, 'bare': tmp_path / 'bare'}
    output = tmp_path / 'out'
    filled = [part.format(**names) for part in arguments]
    if arguments[0] == 'vectors':
        filled += ['--output', str(output)]
    assert main(filled) == 2
    error = capsys.readouterr().err
    assert error.startswith(f'hdc_experiments {arguments[0]}: ')
    assert message in error and error.count('\n') == 1
    assert not output.exists()


def test_an_experiment_is_required():
    with pytest.raises(SystemExit, match='2'):
        main([])


HEAD = 'index,source_index,dx_px_1024,dy_px_1024,dx_px_640,dy_px_640\n'


def test_displacements_are_read(tmp_path):
    file = tmp_path / 'displacements.csv'
    file.write_text(HEAD + '0,0,-109,-27,-68.1,-16.9\n3,3,129,12,80.6,7.5\n')
    assert read_displacements(file) == {0: (-68.1, -16.9), 3: (80.6, 7.5)}


@pytest.mark.parametrize(
    ('content', 'message'),
    [
        ('index,dx_px_640\n0,1\n', "line 2: KeyError\\('dy_px_640'\\)"),
        (HEAD + '0,0,1,1,1,1\n1,1,1,1,left,1\n', 'line 3: .*left'),
        (HEAD + '0,0,1,1,1\n', 'line 2: TypeError'),
        (HEAD + '0,0,1,1,nan,1\n', 'line 2: .*no finite number'),
        (HEAD + '0,0,1,1,1,1\n0,0,1,1,1,1\n', 'line 3: .*given twice'),
        (HEAD, 'has 0 shifts'),
    ],
)
def test_bad_displacements_file(tmp_path, content, message):
    file = tmp_path / 'displacements.csv'
    file.write_text(content)
    with pytest.raises(PlaceRecognitionError, match=message) as raised:
        read_displacements(file)
    assert '\n' not in str(raised.value)


# Shift of the query relative to the reference at each place, pixels right and down at 160 x 80.
MOVES = ((16, 0), (-32, 16), (0, -16), (32, 0), (-16, 16), (0, 0))


@pytest.fixture
def shifted(tmp_path):
    """Return two traverses with queries shifted by multiples of 0.1, and displacements.csv."""
    folder, lines = tmp_path / 'shifted', []
    references, queries = [], []
    for place, (x, y) in enumerate(MOVES):
        scene = cv2.resize(texture(place, 24, 44), (352, 192), interpolation=cv2.INTER_CUBIC)
        references.append(scene[56:136, 96:256])
        queries.append(np.roll(scene, (y, x), (0, 1))[56:136, 96:256])
        lines.append(f'{place},{place},0,0,{4 * x},{4 * y}\n')
    write(folder / 'images' / 'ref', references)
    write(folder / 'images' / 'query', queries)
    (folder / 'displacements.csv').write_text(HEAD + ''.join(lines))
    return folder


SHIFT_FLAGS = ('--extractor', 'gradient_grid', '--image-width', '160', '--dimensions', '1024')


def test_known_shifts_are_estimated(shifted, capsys):
    assert main(['shift', str(shifted), *SHIFT_FLAGS]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith('shifted: 6 true pairs; shift = position in the query minus')
    for line, axis in ((lines[2], 'horizontal'), (lines[3], 'vertical')):
        found, correlation, error, *_ = line.split()
        assert found == axis and '-0.200 to 0.200' in line
        assert float(correlation) > 0.95 and float(error) < 0.01


def test_shift_table():
    measured = np.array([(0.0, 0.0), (0.1, 0.0), (0.2, 0.0)])
    estimated = np.array([(0.0, 0.1), (0.2, 0.0), (0.2, 0.0)])
    _, _, x, y = table('x', MeasuredShifts(measured, estimated)).splitlines()
    # (0, 1, 2) and (0, 2, 2): covariance 2, sums of squares 2 and 8 / 3.
    assert x.split()[:4] == ['horizontal', '0.866', '0.000', '67%']
    assert y.split()[:3] == ['vertical', '-', '0.000']


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['--displacements-x', '1', '--displacements-y', '1'], 'estimated by displacements'),
        (['--max-features', '0'], 'parameter max_features'),
    ],
)
def test_bad_parameters_of_shift(shifted, capsys, arguments, message):
    assert main(['shift', str(shifted), *SHIFT_FLAGS, *arguments]) == 2
    assert message in capsys.readouterr().err


def test_shifts_need_two_traverses_with_all_places(shifted, loop):
    recognizer = assemble(SMALL, CellExtractor())
    dataset = open_dataset(shifted)
    with pytest.raises(PlaceRecognitionError, match='has places 0 to 6, the images are 0 to 5'):
        estimate(dataset, {0: (0, 0), 6: (0, 0)}, recognizer)
    with pytest.raises(PlaceRecognitionError, match='loop: needs images/ref'):
        estimate(open_dataset(loop), {0: (0, 0), 1: (0, 0)}, recognizer)
