# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The experiment `trust`, and score against similarity as a ranking."""

import csv

from conftest import texture
import cv2
from hdc_place_recognition.cli import experiments
from hdc_place_recognition.datasets.dataset import Mode
from hdc_place_recognition.datasets.open_dataset import open_dataset
from hdc_place_recognition.evaluation.evaluate import evaluate, evaluate_dataset
from hdc_place_recognition.experiments.calibration import best_candidates, fit, labeled_evidence
from hdc_place_recognition.experiments.trust_runs import (
    ALL,
    Choices,
    revisits,
    runs_against,
    runs_of,
)
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.factory import calibrations, create_recognizer
import numpy as np
import pytest

FAST = ['--extractor', 'gradient_grid', '--dimensions', '1024']
S = 10**9


def scene(seed, size=(96, 128)):
    """Return an image with structure at several scales."""
    small = cv2.resize(texture(seed, 12, 16), size[::-1], interpolation=cv2.INTER_CUBIC)
    return cv2.addWeighted(small, 0.7, texture(seed + 1000, *size), 0.3, 0)


def write_images(folder, seeds):
    folder.mkdir(parents=True)
    for index, seed in enumerate(seeds):
        cv2.imwrite(str(folder / f'{index:04d}.png'), scene(seed))


def write_loop(folder, places=12, first_seed=0):
    """Write a sequence that shows `places` places twice; the last image shows a new place."""
    seeds = [*range(places), *range(places), 500]
    write_images(folder / 'images', [first_seed + seed for seed in seeds])
    hard = np.eye(len(seeds), k=-places)
    hard[-1] = 0
    # An image also matches itself and the image before, which is too young to be compared.
    soft = hard + np.eye(len(seeds)) + np.eye(len(seeds), k=-1)
    np.savez(folder / 'gt.npz', hard=hard, soft=soft, min_gap=4)
    return folder


def write_traverses(folder, count=6, first_seed=100):
    """Write two traverses of the same places; the map has one place more."""
    for part, more in (('ref', 1), ('query', 0)):
        write_images(folder / 'images' / part, range(first_seed, first_seed + count + more))
    hard = np.eye(count, count + 1)
    np.savez(folder / 'gt.npz', hard=hard, soft=hard, min_gap=-1)
    return folder


def make_one_false(folder):
    """Say that the last image but one shows a new place: a calibration needs a false candidate."""
    with np.load(folder / 'gt.npz') as truth:
        arrays = dict(truth)
    for name in ('hard', 'soft'):
        arrays[name][-2] = 0
    np.savez(folder / 'gt.npz', **arrays)


def run(capsys, *arguments):
    """Return the lines that the command prints."""
    assert experiments.main(['trust', *map(str, arguments), *FAST]) == 0
    return capsys.readouterr().out.splitlines()


def table(lines, first):
    """Return the rows of the table whose first column has this title, as dictionaries."""
    start = next(index for index, line in enumerate(lines) if line.startswith(first + '  '))
    end = lines.index('', start) if '' in lines[start:] else len(lines)
    split = [[cell for cell in line.split('  ') if cell] for line in lines[start:end]]
    cells = [[cell.strip() for cell in row] for row in split]
    return [dict(zip(cells[0], row, strict=True)) for row in cells[1:]]


def test_closures_of_a_loop_are_counted(tmp_path, capsys):
    rows = table(run(capsys, write_loop(tmp_path / 'loop')), 'run')
    assert [row['run'] for row in rows] == ['loop', 'loop, before any revisit']
    loop, before = rows
    assert (loop['images'], loop['to find'], loop['false']) == ('25', '12', '0')
    assert loop['R@1'] == loop['AP'] == loop['proposed'] == '1.000'
    assert float(loop['with soft']) == float(loop['recall']) == int(loop['true']) / 12 > 0.5
    assert (before['images'], before['false'], before['true']) == ('12', '0', '0')
    assert before['recall'] == before['ms extract'] == '-'


def test_candidates_that_are_not_accepted_are_proposed_only(tmp_path, capsys):
    row = table(run(capsys, write_loop(tmp_path / 'loop'), '--min-score', '1'), 'run')[0]
    assert (row['true'], row['recall'], row['with soft']) == ('0', '0.000', '0.000')
    assert row['proposed'] == '1.000'


def test_all_variants_of_sets_by_one_command(tmp_path, capsys):
    loop, pair = write_loop(tmp_path / 'loop'), write_traverses(tmp_path / 'pair')
    make_one_false(loop)
    make_one_false(pair)
    file = tmp_path / 'trust.csv'
    lines = run(capsys, loop, pair, '--all', '--seeds', '2', '--csv', file)
    names = [row['run'] for row in table(lines, 'run')]
    rolls = [
        f'rolled {angles} ({which})'
        for angles in ('15 to 30', '30 to 45')
        for which in ('seed 0', 'seed 1', 'mean')
    ]
    images = [*rolls, 'zoomed 1.5', 'zoomed 0.6', 'shifted', 'every 2', 'every 4', 'backwards']
    assert [name for name in names if 'before' not in name] == [
        'loop',
        *(f'loop, {variant}' for variant in images),
        *('pair', 'pair, reference alone', 'pair, query alone'),
        *(f'pair, {variant}' for variant in (*images, 'swapped')),
        'loop, against pair',
        'pair, against loop',
    ]
    with file.open(newline='') as stream:
        assert [row['run'] for row in csv.DictReader(stream)] == names
    folds = [row['left out'] for row in table(lines, 'left out')]
    assert folds == ['loop', 'loop, variants', 'pair', 'pair, variants']
    assert [line for line in lines if line.startswith('reliability: ')] == [
        f'reliability: {name}' for name in folds
    ]


def test_false_closures_are_listed_with_their_distance(tmp_path, capsys):
    # Ground truth that is five images off: each closure is false.
    folder = write_loop(tmp_path / 'loop')
    hard = np.eye(25, k=-12 - 5)
    np.savez(folder / 'gt.npz', hard=hard, soft=hard, min_gap=4)
    lines = run(capsys, folder, '--min-score', '0.5')
    rows = table(lines, 'false closure')
    assert len(rows) == int(table(lines, 'run')[0]['false']) > 5
    for row in rows:
        query, match = int(row['query']), int(row['match'])
        assert query - match == 12
        assert row['frames off'] == ('5' if query >= 17 else '-')


def test_each_set_is_calibrated_on_the_others(tmp_path, capsys):
    sets = write_loop(tmp_path / 'a'), write_traverses(tmp_path / 'b')
    for folder in sets:
        make_one_false(folder)
    rows = table(run(capsys, *sets), 'left out')
    params = Params(extractor='gradient_grid', dimensions=1024)
    for row, path in zip(rows, sets[::-1], strict=True):
        evaluation = evaluate_dataset(open_dataset(path), params)
        shipped, _ = calibrations(evaluation.identity)
        fitted = fit([labeled_evidence(best_candidates(evaluation), shipped)])
        assert (row['slope'], row['center']) == (f'{fitted.slope:.2f}', f'{fitted.center:.2f}')
    assert rows[0]['slope'] != rows[1]['slope']


def test_runs_of_several_seeds_are_followed_by_their_mean(tmp_path, capsys):
    lines = run(capsys, write_loop(tmp_path / 'loop'), '--roll', '45', '--seeds', '3')
    *seeds, mean = table(lines, 'run')[-4:]
    assert [row['run'] for row in seeds] == [
        f'loop, rolled 0 to 45 (seed {seed})' for seed in range(3)
    ]
    assert mean['run'] == 'loop, rolled 0 to 45 (mean)'
    for title, decimals in (('true', 1), ('recall', 3), ('AP', 3)):
        expected = sum(float(row[title]) for row in seeds) / 3
        assert float(mean[title]) == pytest.approx(expected, abs=0.6 * 10**-decimals)
    assert mean['highest wrong'] == max(row['highest wrong'] for row in seeds)


def test_a_diagram_of_each_set(tmp_path, capsys):
    pytest.importorskip('matplotlib')
    sets = write_loop(tmp_path / 'a'), write_traverses(tmp_path / 'b')
    run(capsys, *sets, '--plot', tmp_path / 'trust.png')
    assert sorted(file.name for file in tmp_path.glob('*.png')) == ['trust_a.png', 'trust_b.png']


def test_only_revisits_are_turned(tmp_path):
    folder = write_loop(tmp_path / 'loop')
    plain = open_dataset(folder)
    assert revisits(plain) == frozenset(range(12, 24))
    rolled = next(
        found for found in runs_of(folder, Choices(rolls=[(15, 30)])) if 'rolled' in found.name
    )
    same = [
        np.array_equal(before.image, after.image)
        for before, after in zip(plain.queries, rolled.dataset.queries, strict=True)
    ]
    assert same == [True] * 12 + [False] * 12 + [True]


def test_variants_keep_their_ground_truth(tmp_path):
    found = {known.name: known.dataset for known in runs_of(write_loop(tmp_path / 'a'), ALL)}
    for name, to_find in (('a', 12), ('a, every 2', 6), ('a, backwards', 12)):
        stamps_ns = np.array([frame.stamp_ns for frame in found[name].queries])
        hard = found[name].ground_truth.truth(stamps_ns, stamps_ns).hard
        # Of matching images the pixels are the same.
        images = [frame.image for frame in found[name].queries]
        pairs = [pair for pair in np.argwhere(hard).tolist() if pair[0] > pair[1]]
        assert len(pairs) == to_find, name
        assert all(np.array_equal(images[query], images[match]) for query, match in pairs)


def test_swapped_and_limited_traverses(tmp_path):
    folder = tmp_path / 'pair'
    for part, count in (('ref', 8), ('query', 5)):
        write_images(folder / 'images' / part, range(count))
    np.savez(folder / 'gt.npz', hard=np.eye(5, 8), soft=np.eye(5, 8), min_gap=-1)
    found = {known.name: known.dataset for known in runs_of(folder, Choices(swap=True, queries=3))}
    sizes = {
        name: (len(known.queries), len(known.reference or ())) for name, known in found.items()
    }
    assert sizes == {
        'pair': (3, 8),
        'pair, reference alone': (3, 0),
        'pair, query alone': (3, 0),
        'pair, swapped': (3, 5),
    }
    swapped = found['pair, swapped']
    truth = swapped.ground_truth.truth(np.arange(3) * S, np.arange(5) * S)
    assert np.array_equal(truth.hard, np.eye(3, 5))


def test_sets_against_each_other_have_nothing_in_common(tmp_path):
    paths = [write_loop(tmp_path / name, 4) for name in 'abc'] + [write_traverses(tmp_path / 'd')]
    found = list(runs_against(paths, ALL))
    assert [known.name for known in found] == [
        *('a, against b', 'b, against c', 'c, against d', 'd, against a'),
        *('a, against c', 'b, against d', 'c, against a', 'd, against b'),
    ]
    for known in found:
        dataset = known.dataset
        assert dataset.mode is Mode.TRAVERSES and not revisits(dataset)
    assert [len(found[index].dataset.queries) for index in (0, 3)] == [5, 3]
    assert [len(found[index].dataset.reference) for index in (2, 3)] == [7, 9]
    assert not list(runs_against(paths[:1], ALL)) and not list(runs_against(paths, Choices()))


@pytest.mark.parametrize('angles', [('30', '15'), ('1', '2', '3')])
def test_a_range_that_is_none_is_refused(tmp_path, capsys, angles):
    folder = write_loop(tmp_path / 'loop', 4)
    assert experiments.main(['trust', str(folder), '--roll', *angles, *FAST]) == 2
    assert 'roll' in capsys.readouterr().err


def test_real_sequence_and_its_reverse(shared_data, capsys):
    folder = shared_data / 'rtabmap_corridor_2laps'
    rows = table(run(capsys, folder, '--reversed'), 'run')
    assert [row['run'] for row in rows] == [
        folder.name,
        f'{folder.name}, before any revisit',
        f'{folder.name}, backwards',
        f'{folder.name}, backwards, before any revisit',
    ]
    # No accepted closure is false, also with a smaller d than in the calibration.
    assert [row['false'] for row in rows] == ['0'] * 4


def test_score_ranks_best_matches_better_than_similarity(shared_data):
    dataset = open_dataset(shared_data / 'rtabmap_corridor_2laps')
    params = Params(extractor='gradient_grid', dimensions=1024).replace(**dataset.overrides)
    verified = evaluate(dataset, create_recognizer(params)).scores
    unverified = evaluate(dataset, create_recognizer(params.replace(verify=False))).scores
    # Words of keypoints find what the vector does not.
    assert verified.ranking.average_precision > unverified.ranking.average_precision
    assert verified.ranking.recall_at_full_precision > unverified.ranking.recall_at_full_precision
    assert verified.ranking.recall_at_full_precision >= verified.closures.recall
