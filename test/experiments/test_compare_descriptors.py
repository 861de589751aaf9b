# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The experiments: what is compared, kept and counted, on tiny folders."""

import csv

from conftest import CellExtractor, texture
import cv2
from hdc_place_recognition.cli.experiments import main
from hdc_place_recognition.datasets.open_dataset import open_dataset, Options
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
from hdc_place_recognition.experiments.runs import in_memory, KeepingExtractor, measure, Plan, Run
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
    Variant('default', {}, DEFAULT, 'the base'),
    Variant('smaller', {'dimensions': 128}, 'dropped', 'a test'),
)


class CountingExtractor(CellExtractor):
    """Counts the images that it looks at."""

    calls = 0

    def extract(self, image):
        """Return the features."""
        CountingExtractor.calls += 1
        return super().extract(image)


@pytest.fixture
def counted(monkeypatch):
    """Make the experiment use the counting extractor."""
    CountingExtractor.calls = 0
    made = []

    def create(name, *, image_width, max_features, threads):
        made.append((name, image_width, max_features, threads))
        return CountingExtractor()

    monkeypatch.setattr(runs, 'create_extractor', create)
    return made


@pytest.fixture
def loop(tmp_path):
    """Return a folder with a noisy loop of four places and its ground truth."""
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
    return Plan([open_dataset(folder, None, Options())], variants, seeds, base)


def test_every_variant_changes_the_default():
    made = [Params().replace(**variant.changes) for variant in VARIANTS]
    assert [variant.name for variant in VARIANTS if not variant.changes] == ['default']
    assert len(set(made)) == len({variant.name for variant in VARIANTS}) == len(VARIANTS)


def test_interval_is_students():
    # Deviation 1 of three values: 4.303 / sqrt(3).
    assert half_interval([1.0, 2.0, 3.0]) == pytest.approx(2.484, abs=1e-3)
    assert half_interval([0.5, 0.5]) == 0.0
    assert half_interval([1.0]) is None
    # 32 values, deviation 0.508: beyond the table its last entry is used.
    assert half_interval([0.0, 1.0] * 16) == pytest.approx(2.042 * 0.508 / 32**0.5, rel=1e-3)


def test_table_has_means_and_intervals():
    runs = [
        Run('one', 'default', 0, 0.4, 1.0, 0.1),
        Run('one', 'default', 1, 0.6, 0.5, 0.1),
        Run('two', 'default', 0, 0.8, 0.2, 0.1),
        Run('two', 'default', 1, 0.8, 0.2, 0.1),
    ]
    lines = markdown(runs, PAIR[:1]).splitlines()
    cells = [[cell.strip() for cell in line.strip('|').split('|')] for line in lines]
    assert cells[0] == ['variant', 'changes', 'one', 'two', 'mean AP', 'verdict', 'why']
    # 12.706 * deviation / sqrt(2), over the seeds: of .4 and .6, and of the means .6 and .7.
    assert cells[2][2:5] == ['0.500 ± 1.271, 0.75', '0.800 ± 0.000, 0.20', '0.650 ± 0.635']
    assert len(lines) == 3


def test_images_are_known_by_their_content():
    CountingExtractor.calls = 0
    keeping, image = KeepingExtractor(CountingExtractor()), texture(1)
    first = keeping.extract(image)
    assert keeping.extract(image.copy()) is first
    assert keeping.extract(np.asfortranarray(image)) is first
    assert CountingExtractor.calls == 1
    keeping.extract(image.reshape(64, 48))
    keeping.extract(texture(2))
    assert CountingExtractor.calls == 3
    assert keeping.identity == CellExtractor.identity


def test_features_that_do_not_fit_are_extracted_again():
    CountingExtractor.calls = 0
    size = sum(
        a.nbytes
        for a in vars(CellExtractor().extract(texture(0))).values()
        if isinstance(a, np.ndarray)
    )
    keeping = KeepingExtractor(CountingExtractor(), limit_bytes=size)
    for _ in range(3):
        for seed in (0, 1):
            same = keeping.extract(texture(seed))
            expected = CellExtractor().extract(texture(seed)).descriptors
            np.testing.assert_array_equal(same.descriptors, expected)
    assert CountingExtractor.calls == 1 + 3


def test_images_in_memory_are_the_same(loop):
    dataset = open_dataset(loop, None, Options())
    kept = in_memory(dataset)
    assert isinstance(kept.queries, list)
    for (stamp, image), (kept_stamp, kept_image) in zip(
        dataset.queries, kept.queries, strict=True
    ):
        assert stamp == kept_stamp
        np.testing.assert_array_equal(image, kept_image)


def test_runs_are_plain_evaluations_with_features_extracted_once(loop, counted):
    runs = list(measure(plan(loop)))
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
        dataset = open_dataset(loop, None, Options())
        params = params.replace(**dataset.overrides)
        ranking = evaluate(dataset, assemble(params, CellExtractor())).judgement.ranking
        assert (run.average_precision, run.recall_at_1) == (
            ranking.average_precision,
            ranking.recall_at_1,
        )


def test_another_image_width_has_an_extractor_of_its_own(loop, counted):
    wide = Variant('wide', {'image_width': 640}, 'dropped', 'a test')
    runs = list(measure(plan(loop, (*PAIR, wide))))
    assert [width for _, width, *_ in counted] == [320, 640]
    assert CountingExtractor.calls == 2 * len(PLACES)
    assert len(runs) == 6


def test_nothing_to_be_found_is_an_error(loop, counted):
    nothing = np.zeros((len(PLACES), len(PLACES)))
    np.savez(loop / 'gt.npz', hard=nothing, soft=nothing, min_gap=2)
    with pytest.raises(PlaceRecognitionError, match='loop: the ground truth has no pair'):
        list(measure(plan(loop)))


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
    # What took an hour is not overwritten.
    assert main(command) == 2
    assert 'vectors.csv is there already' in capsys.readouterr().err


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


def test_an_experiment_is_needed():
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
def test_bad_displacements_are_named(tmp_path, content, message):
    file = tmp_path / 'displacements.csv'
    file.write_text(content)
    with pytest.raises(PlaceRecognitionError, match=message) as raised:
        read_displacements(file)
    assert '\n' not in str(raised.value)


# Of each place, pixels of a query of 160 x 80 right and down against its reference.
MOVES = ((16, 0), (-32, 16), (0, -16), (32, 0), (-16, 16), (0, 0))


@pytest.fixture
def shifted(tmp_path):
    """Return two traverses whose queries are shifted by steps of .1, with displacements.csv."""
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
    assert lines[0].startswith('shifted: 6 true pairs; shift = position in the query less')
    for line, axis in ((lines[2], 'horizontal'), (lines[3], 'vertical')):
        found, correlation, error, *_ = line.split()
        assert found == axis and '-0.200 to 0.200' in line
        assert float(correlation) > 0.95 and float(error) < 0.01


def test_shift_table_of_hand_written_numbers():
    measured = np.array([(0.0, 0.0), (0.1, 0.0), (0.2, 0.0)])
    estimated = np.array([(0.0, 0.1), (0.2, 0.0), (0.2, 0.0)])
    _, _, x, y = table('x', MeasuredShifts(measured, estimated)).splitlines()
    # Of (0, 1, 2) and (0, 2, 2): covariance 2, squares 2 and 8 / 3.
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


def test_shifts_need_two_traverses_with_these_places(shifted, loop):
    recognizer = assemble(SMALL, CellExtractor())
    dataset = open_dataset(shifted, None, Options())
    with pytest.raises(PlaceRecognitionError, match='has places 0 to 6, the images are 0 to 5'):
        estimate(dataset, {0: (0, 0), 6: (0, 0)}, recognizer)
    with pytest.raises(PlaceRecognitionError, match='loop: needs images/ref'):
        estimate(open_dataset(loop, None, Options()), {0: (0, 0), 1: (0, 0)}, recognizer)
