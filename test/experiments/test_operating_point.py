# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The experiment `trust`, and score against similarity as a ranking."""

from hdc_place_recognition.cli import experiments
from hdc_place_recognition.datasets.open_dataset import open_dataset
from hdc_place_recognition.evaluation.evaluate import evaluate
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.factory import create_recognizer

FAST = ['--extractor', 'gradient_grid', '--dimensions', '1024']


def test_table_of_a_sequence_and_its_reverse(shared_data, capsys):
    folder = shared_data / 'rtabmap_corridor_2laps'
    assert experiments.main(['trust', str(folder), '--reversed', *FAST]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert 'ms extract  encode  query  keypoints  verify  KB' in lines[0]
    at_false = lines[0].index('false')
    names = [line.split('  ')[0] for line in lines[1:5]]
    sequence = folder.name
    assert names == [
        sequence,
        f'{sequence}, before any revisit',
        f'{sequence}, backwards',
        f'{sequence}, backwards, before any revisit',
    ]
    # No accepted closure is false, also with a smaller d than in the calibration.
    assert [line[at_false:].split()[0] for line in lines[1:5]] == ['0'] * 4
    assert any(line.startswith('predicted') for line in lines)


def test_score_ranks_best_matches_better_than_similarity(shared_data):
    dataset = open_dataset(shared_data / 'rtabmap_corridor_2laps')
    params = Params(extractor='gradient_grid', dimensions=1024).replace(**dataset.overrides)
    verified = evaluate(dataset, create_recognizer(params)).scores
    unverified = evaluate(dataset, create_recognizer(params.replace(verify=False))).scores
    assert verified.ranking.average_precision == unverified.ranking.average_precision
    assert verified.ranking.recall_at_full_precision > unverified.ranking.recall_at_full_precision
    assert verified.ranking.recall_at_full_precision >= verified.closures.recall
