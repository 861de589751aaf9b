# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Output, files and errors of hdc_evaluate."""

import csv
import json

from bag_messages import CAMERA, image, odometry, write_bag
from conftest import CellExtractor, texture
import cv2
from hdc_place_recognition.cli import evaluate
from hdc_place_recognition.evaluation import evaluate as evaluation
from hdc_place_recognition.evaluation import plots
from hdc_place_recognition.params.formats import load_yaml
from hdc_place_recognition.recognition.factory import assemble
import numpy as np
import pytest

S = 10**9
# Documented keys of metrics.json, and keys added later.
KEYS = {
    'average_precision',
    'recall_at_1',
    'recall_at_5',
    'recall_at_10',
    'recall_at_full_precision',
    'area_best_match',
    'closures_true',
    'closures_false',
    'closures_ignored',
    'queries_with_match',
    'precision',
    'recall',
    'ms_per_image',
    'images',
    'features_per_image',
    'database_bytes',
}
ADDED = {'name', 'average_precision_100', 'closures', 'images_passed_over'}
PLACES = (0, 1, 2, 3, 4, 5, 0, 1, 9)
SMALL = ['--dimensions', '512', '--min-score', '0.8', '--top-k', '3']


@pytest.fixture(autouse=True)
def tiny_extractor(monkeypatch):
    """Replace the extractor by one without weights."""
    monkeypatch.setattr(
        evaluation, 'create_recognizer', lambda params: assemble(params, CellExtractor())
    )


@pytest.fixture
def loop(tmp_path):
    """Return a folder of nine images; images 6 and 7 show the places of images 0 and 1."""
    folder = tmp_path / 'loop'
    (folder / 'images').mkdir(parents=True)
    for index, place in enumerate(PLACES):
        cv2.imwrite(str(folder / 'images' / f'{index:02d}.png'), texture(place))
    hard = np.tril(np.equal.outer(PLACES, PLACES), -1)
    np.savez(folder / 'gt.npz', hard=hard, soft=hard, min_gap=3)
    return folder


def run(capsys, *arguments):
    """Run the command; return exit code, stdout and stderr."""
    code = evaluate.main([str(argument) for argument in arguments])
    return code, *capsys.readouterr()


def read_csv(file):
    with file.open(newline='') as stream:
        return list(csv.DictReader(stream))


def test_json_prints_only_the_content_of_metrics_json(loop, tmp_path, capsys):
    code, out, _ = run(capsys, loop, *SMALL, '--json', '--output', tmp_path / 'out')
    assert code == 0
    metrics = json.loads(out)
    assert set(metrics) == KEYS | ADDED
    assert metrics == json.loads((tmp_path / 'out' / 'loop_1' / 'metrics.json').read_text())
    assert metrics['average_precision'] == metrics['recall_at_1'] == 1.0
    assert (metrics['closures_true'], metrics['closures_false']) == (2, 0)
    assert (metrics['precision'], metrics['recall'], metrics['queries_with_match']) == (1, 1, 2)
    assert (metrics['images'], metrics['features_per_image']) == (9, 16)
    stages = {'read', 'extract', 'encode', 'keypoints', 'query', 'insert', 'verify', 'total'}
    assert set(metrics['ms_per_image']) == stages


def test_several_inputs_give_a_list_or_a_summary(loop, tmp_path, capsys):
    code, out, _ = run(capsys, loop, loop, *SMALL, '--json', '--output', tmp_path / 'out')
    assert code == 0
    assert [metrics['name'] for metrics in json.loads(out)] == ['loop', 'loop']
    _, out, _ = run(capsys, loop, loop, *SMALL, '--output', tmp_path / 'out')
    rows = out.splitlines()[-3:]
    assert rows[0].split()[:3] == ['name', 'images', 'average_precision']
    assert [row.split()[:3] for row in rows[1:]] == [['loop', '9', '1.000']] * 2


def test_table(loop, tmp_path, capsys):
    _, out, _ = run(capsys, loop, *SMALL, '--output', tmp_path / 'out')
    cells = dict(line.split(maxsplit=1) for line in out.splitlines() if len(line.split()) > 1)
    assert cells['average_precision'] == '1.000'
    assert cells['closures_true'] == '2'
    assert cells['mode'].startswith('one sequence')
    # Images 3 to 8 have 1 to 6 images that are old enough.
    assert cells['pairs'] == '21 compared: 2 to be found, 0 ignored'
    assert cells['->'] == str(tmp_path / 'out' / 'loop_1')


def test_results_are_never_overwritten(loop, tmp_path, capsys):
    for _ in range(2):
        run(capsys, loop, *SMALL, '--output', tmp_path / 'out')
    (tmp_path / 'out' / 'loop_1' / 'metrics.json').unlink()
    run(capsys, loop, *SMALL, '--output', tmp_path / 'out')
    assert sorted(folder.name for folder in (tmp_path / 'out').iterdir()) == [
        'loop_1',
        'loop_2',
        'loop_3',
    ]
    assert not (tmp_path / 'out' / 'loop_1' / 'metrics.json').exists()


def test_candidates_file(loop, tmp_path, capsys):
    run(capsys, loop, *SMALL, '--output', tmp_path)
    rows = read_csv(tmp_path / 'loop_1' / 'candidates.csv')
    assert list(rows[0]) == [
        'query_stamp_ns',
        'match_stamp_ns',
        'match_id',
        'similarity',
        'score',
        'inliers',
        'accepted',
        'shift_x',
        'shift_y',
        'reason',
        'qx',
        'qy',
        'qz',
        'qw',
        'query_session',
        'match_session',
        'truth',
    ]
    accepted = [row for row in rows if row['accepted'] == '1']
    assert [(row['query_stamp_ns'], row['match_stamp_ns'], row['match_id'], row['truth'])
            for row in accepted] == [
        (str(6 * S), '0', '0', 'true'), (str(7 * S), str(S), '1', 'true')]  # fmt: skip
    assert float(accepted[0]['similarity']) == pytest.approx(1, abs=1e-5)
    assert {row['truth'] for row in rows if row['accepted'] == '0'} == {'false'}
    assert {row['inliers'] for row in rows} == {'-1'}


def test_area_of_the_curve_file_is_the_metric(loop, tmp_path, capsys):
    # A small d, so that the metric is not 1.
    _, out, _ = run(capsys, loop, '--dimensions', '64', '--json', '--output', tmp_path)
    for curve, key in (('all_pairs', 'average_precision'), ('best_match', 'area_best_match')):
        area = last = 0.0
        for row in read_csv(tmp_path / 'loop_1' / 'precision_recall.csv'):
            if row['curve'] == curve:
                area += (float(row['recall']) - last) * float(row['precision'])
                last = float(row['recall'])
        assert area == pytest.approx(json.loads(out)[key])


def test_written_parameters_repeat_the_run(loop, tmp_path, capsys):
    run(capsys, loop, *SMALL, '--seed', '5', '--output', tmp_path)
    written = tmp_path / 'loop_1' / 'params.yaml'
    values = load_yaml(written)
    assert (values['seed'], values['dimensions']) == (5, 512)
    # The overrides of the dataset are written too.
    assert (values['exclude_recent_s'], values['min_interval_s']) == (3.0, 0.0)
    run(capsys, loop, '--params-file', written, '--output', tmp_path)
    for name in ('candidates.csv', 'precision_recall.csv', 'params.yaml'):
        first, second = (tmp_path / f'loop_{n}' / name for n in (1, 2))
        assert first.read_text() == second.read_text()


def test_flag_wins_over_file(loop, tmp_path, capsys):
    file = tmp_path / 'mine.yaml'
    file.write_text('/**:\n  ros__parameters:\n    dimensions: 256\n    seed: 3\n')
    run(capsys, loop, '--params-file', file, '--seed', '4', '--output', tmp_path)
    values = load_yaml(tmp_path / 'loop_1' / 'params.yaml')
    assert (values['dimensions'], values['seed']) == (256, 4)


def test_without_ground_truth_metrics_are_null(loop, tmp_path, capsys):
    (loop / 'gt.npz').unlink()
    arguments = [*SMALL, '--exclude-recent-s', '3', '--output', tmp_path]
    code, out, _ = run(capsys, loop, *arguments, '--json')
    metrics = json.loads(out)
    assert code == 0
    assert metrics['closures'] == 2
    known = {'name', 'closures', 'images_passed_over', 'ms_per_image', 'images'}
    known |= {'features_per_image', 'database_bytes'}
    assert {key for key in metrics if metrics[key] is not None} == known
    assert {row['truth'] for row in read_csv(tmp_path / 'loop_1' / 'candidates.csv')} == {''}
    assert not read_csv(tmp_path / 'loop_1' / 'precision_recall.csv')
    _, out, _ = run(capsys, loop, *arguments)
    assert ['average_precision', '-'] in [line.split() for line in out.splitlines()]


def bag_of(folder, truth=True):
    """Write the loop as a bag at 1 Hz, with odometry if `truth` is set."""
    messages = []
    for index, place in enumerate(PLACES):
        message = image((index + 1) * S)
        pixels = texture(place)
        message.height, message.width = pixels.shape
        message.step, message.data = pixels.shape[1], pixels.ravel()
        messages.append((CAMERA, message))
        if truth:
            messages.append(('/odom', odometry((index + 1) * S + 1000, 10.0 * place)))
    return write_bag(folder, messages)


def test_bag_with_ground_truth(tmp_path, capsys, caplog):
    caplog.set_level('INFO')
    bag = bag_of(tmp_path / 'drive')
    arguments = [*SMALL, '--exclude-recent-s', '3', '--output', tmp_path, '--json']
    code, out, _ = run(capsys, bag, '--ground-truth-topic', '/odom', *arguments)
    metrics = json.loads(out)
    assert code == 0
    assert (metrics['queries_with_match'], metrics['closures_true']) == (2, 2)
    assert metrics['average_precision'] == 1.0
    assert 'poses for 9 of 9 images (max. gap 1e-06 s)' in caplog.messages
    code, out, _ = run(capsys, bag, *arguments)
    assert (json.loads(out)['closures'], json.loads(out)['precision']) == (2, None)


def test_odometry_of_a_bag_selects_keyframes(tmp_path, capsys):
    bag = bag_of(tmp_path / 'drive')
    still = ['--keyframe-distance-m', '15', '--keyframe-angle-deg', '10', '--json', *SMALL]
    still += ['--exclude-recent-s', '0', '--odom-tolerance-s', '2', '--output', tmp_path]
    _, without, _ = run(capsys, bag, *still)
    _, with_odom, _ = run(capsys, bag, '--odom-topic', '/odom', *still)
    assert json.loads(with_odom)['database_bytes'] < json.loads(without)['database_bytes']
    code, _, err = run(capsys, bag, '--database', bag, '--odom-topic', '/odom', *still)
    assert code == 2 and '--odom-topic /odom: two traverses' in err


def test_two_bags(tmp_path, capsys):
    first, second = bag_of(tmp_path / 'monday'), bag_of(tmp_path / 'tuesday')
    code, out, _ = run(
        capsys, second, '--database', first, '--ground-truth-topic', '/odom', '--json', *SMALL,
        '--exclude-recent-s', '1000', '--output', tmp_path,
    )  # fmt: skip
    metrics = json.loads(out)
    assert code == 0
    assert metrics['name'] == 'tuesday'
    assert (metrics['images'], metrics['queries_with_match'], metrics['recall']) == (18, 9, 1.0)


def test_skip_bad(tmp_path, capsys):
    bag = write_bag(
        tmp_path / 'bag', [(CAMERA, image(S)), (CAMERA, image(2 * S, size=1)), (CAMERA, image(S))]
    )
    code, out, err = run(capsys, bag, *SMALL, '--json', '--output', tmp_path)
    assert (code, out) == (2, '')
    assert 'message 2' in err and '--skip-bad' in err
    code, out, _ = run(capsys, bag, *SMALL, '--json', '--output', tmp_path, '--skip-bad')
    assert code == 0
    assert (json.loads(out)['images'], json.loads(out)['images_passed_over']) == (1, 1)


@pytest.mark.parametrize(
    'arguments, reason',
    [
        (['nowhere'], 'nowhere does not exist'),
        (['loop', '--params-file', 'missing.yaml'], 'missing.yaml'),
        (['loop', '--params-file', 'odd.yaml'], 'unknown parameter dimension;'),
        (['loop', '--n-x', '0'], 'n_x: 0 is outside 1 to 64'),
        (['loop', '--radius', '0'], '--radius 0: must be above 0'),
        (['loop', '--max-angle', 'nan'], '--max-angle nan: must be above 0'),
        (['loop', '--output', 'odd.yaml'], 'odd.yaml'),
        (['loop', '--database', 'nowhere'], 'nowhere does not exist'),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    loop, tmp_path, capsys, monkeypatch, arguments, reason
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'odd.yaml').write_text('/**:\n  ros__parameters:\n    dimension: 3\n')
    code, out, err = run(capsys, *arguments)
    assert (code, out) == (2, '')
    assert err.startswith('hdc_evaluate: ') and reason in err
    assert err.count('\n') == 1


def test_plot_writes_images(loop, tmp_path, capsys):
    pytest.importorskip('matplotlib')
    code, _, _ = run(capsys, loop, *SMALL, '--plot', '--output', tmp_path)
    assert code == 0
    for name in ('closures.png', 'precision_recall.png'):
        picture = cv2.imread(str(tmp_path / 'loop_1' / name))
        assert min(picture.shape[:2]) > 300 and picture.std() > 10


def test_plot_without_truth_and_closures(loop, tmp_path, capsys):
    pytest.importorskip('matplotlib')
    (loop / 'gt.npz').unlink()
    code, _, _ = run(capsys, loop, '--plot', '--min-score', '1', '--output', tmp_path)
    assert code == 0
    drawn = {file.name for file in (tmp_path / 'loop_1').glob('*.png')}
    assert drawn == {'closures.png'}


def test_plot_without_matplotlib_names_the_extra(loop, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(plots, 'find_spec', lambda name: None)
    code, _, err = run(capsys, loop, '--plot', '--output', tmp_path / 'out')
    assert code == 2
    assert "pip install 'hdc_place_recognition[plot]'" in err
    # The error comes before any work is done.
    assert not (tmp_path / 'out').exists()


def test_progress_bar_only_on_a_terminal(loop, tmp_path, capsys, monkeypatch):
    pytest.importorskip('tqdm')
    _, _, err = run(capsys, loop, *SMALL, '--json', '--output', tmp_path)
    assert '9/9' not in err
    monkeypatch.setattr('sys.stderr.isatty', lambda: True)
    _, out, err = run(capsys, loop, *SMALL, '--json', '--output', tmp_path)
    assert '9/9' in err
    assert json.loads(out)['images'] == 9
