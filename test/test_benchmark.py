# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The benchmark measures what it says; how fast this machine is, no test asks."""

import json

from hdc_place_recognition.benchmark import search
from hdc_place_recognition.benchmark.command import main
from hdc_place_recognition.benchmark.report import curves, table
from hdc_place_recognition.benchmark.timing import each_milliseconds, Measurement
from hdc_place_recognition.benchmark.vectors import World
import numpy as np
import pytest


def test_small_run_prints_and_writes(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(search, '_QUERIES', 3)
    monkeypatch.setattr(search, 'TWO_STAGES_FROM', 0)
    assert main(['--only', 'search', '--sizes', '60', '--output', str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    written = json.loads((tmp_path / 'benchmark.json').read_text())['measurements']
    assert {each['name'] for each in written} >= {
        'read bandwidth',
        'exact query, 1 form, 60 rows',
        'exact query, 25 forms, 60 rows',
        'insertion, median, 60 rows',
        'two-stage recall@1, 60 rows',
    }
    assert all(each['value'] > 0 and each['name'] in printed for each in written)
    recalls = [each['value'] for each in written if 'recall' in each['name']]
    assert recalls == [1, 1]


def test_bad_size_is_a_usage_error(capsys):
    with pytest.raises(SystemExit):
        main(['--sizes', '0'])
    assert 'must be 1 or more' in capsys.readouterr().err


def test_unwritable_output_is_one_line(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr('hdc_place_recognition.benchmark.command.read_bandwidth', lambda: 1.0)
    (tmp_path / 'file').write_text('')
    words = ['--only', 'search', '--sizes', '5', '--output', str(tmp_path / 'file')]
    assert main(words) == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith('hdc_benchmark: ')


def test_table_and_curves():
    measured = [
        Measurement('exact query, 1 form, 1000 rows', 0.5, 'ms', 1.1, 'bandwidth', '<= 1.15'),
        Measurement('insertion, median, 1000 rows', 20, 'us'),
        Measurement('exact query, 1 form, 100 rows', 0.05, 'ms'),
    ]
    assert '1.100  bandwidth  <= 1.15' in table(measured)
    assert curves(measured) == {
        'exact query, 1 form': [(100, 0.05), (1000, 0.5)],
        'insertion, median': [(1000, 0.02)],
    }


def test_world_is_the_same_in_any_order_and_clustered():
    world, again = World(1000), World(1000)
    late = again.row(7)
    rows = np.stack([world.row(number) for number in range(10)])
    assert np.array_equal(rows[7], late)
    alike = rows @ rows.T
    assert alike[0, 1:5].min() > alike[0, 5:].max() > 0.1
    assert world.query(0).shape == (25, 4096)


def test_each_run_is_timed():
    calls = []
    assert len(each_milliseconds(lambda: calls.append(0), 3)) == len(calls) == 3
