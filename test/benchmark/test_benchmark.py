# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The parts of the benchmark on small inputs; the speed of the machine is not tested."""

import json

from conftest import ROOT
from hdc_place_recognition.benchmark import memory, node, search
from hdc_place_recognition.benchmark.command import main
from hdc_place_recognition.benchmark.filling import fill_alone, FillTask
from hdc_place_recognition.benchmark.images import street
from hdc_place_recognition.benchmark.report import curves, table
from hdc_place_recognition.benchmark.settings import Settings
from hdc_place_recognition.benchmark.timing import each_milliseconds, Measurement
from hdc_place_recognition.benchmark.vectors import LargeWorld, World
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.recognition.factory import create_recognizer
from hdc_place_recognition.results import Frame
import numpy as np
import pytest


def test_small_run_prints_and_writes(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(search, '_QUERIES', 3)
    monkeypatch.setattr(search, 'TWO_STAGES_FROM', 0)
    assert main(['--only', 'search', '--sizes', '60', '--output', str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    written = json.loads((tmp_path / 'benchmark.json').read_text())['measurements']
    assert {item['name'] for item in written} >= {
        'read bandwidth',
        'float32 products',
        'exact query, 1 form, 60 rows',
        'exact query, 25 forms, 60 rows',
        'insertion, median, 60 rows',
        'two-stage query, 25 forms: recall@1, 60 rows',
        'two-stage query, half floats, 60 rows',
    }
    assert all(item['value'] > 0 and item['name'] in printed for item in written)
    recalls = [item['value'] for item in written if 'recall' in item['name']]
    assert recalls[:2] == [1, 1] and len(recalls) == 4 and recalls[3] >= 0.9


def test_node_answers_and_accounts_for_every_image(monkeypatch):
    pytest.importorskip('rclpy', reason='needs ROS')
    profile = ROOT / 'config' / 'large_images.xml'
    monkeypatch.setenv('FASTRTPS_DEFAULT_PROFILES_FILE', str(profile))
    monkeypatch.setattr(node, '_KEYFRAMES', 40)
    monkeypatch.setattr(node, '_SETTINGS', (((160, 120), 1, (10,)),))
    monkeypatch.setattr(node, '_SECONDS', 1.0)
    settings = Settings(
        Params(extractor='gradient_grid'), bandwidth=1.0, products=1.0, sizes=(), images=4
    )
    found = {item.name.partition(': ')[2]: item.value for item in node.measure_node(settings)}
    assert found['images sent'] == 10 and found['images unaccounted for'] == 0
    assert 0 < found['images answered'] <= 10
    assert 0 < found['latency, median'] <= found['latency, 99 %']
    assert found['parameter call, median'] > 0 and found['CPU of the process'] > 0


@pytest.mark.parametrize('package', ['rclpy', 'psutil'])
def test_node_is_skipped_without_a_package(monkeypatch, caplog, package):
    monkeypatch.setattr(node, 'find_spec', lambda name: None if name == package else name)
    assert list(node.measure_node(Settings(Params(), 1.0, 1.0, (), 1))) == []
    assert caplog.messages == [f'{package} is not installed: the node is skipped']


def test_large_images_profile_is_found():
    assert node._large_images_profile() == ROOT / 'config' / 'large_images.xml'


def test_database_of_the_node_contains_matches_of_the_images():
    pytest.importorskip('rclpy', reason='needs ROS')
    from hdc_place_recognition.benchmark.node_process import fill, LoadTask

    task = LoadTask(keyframes=60, images=3, width=160, height=120)
    recognizer = create_recognizer(Params(extractor='gradient_grid'))
    fill(recognizer, task)
    assert len(recognizer.database) == 60
    first = recognizer.process(Frame(10**18, street(task.images, task.width, task.height)[0]))
    rows = [candidate.match_id for candidate in first.candidates if candidate.similarity > 0.5]
    assert sorted(rows) == [0, 30]
    assert all(candidate.inliers > 30 for candidate in first.candidates[:2])


def test_memory_is_measured_in_processes_of_their_own(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr('hdc_place_recognition.benchmark.command.read_bandwidth', lambda: 1.0)
    small = {'_IMAGES': 600, '_MANY': 300, '_KEPT': 60, '_MEGABYTES': 6.0, '_MILLION': 900}
    for name, value in {**small, '_QUERIES': 3}.items():
        monkeypatch.setattr(memory, name, value)
    monkeypatch.setattr(memory, 'gettempdir', lambda: str(tmp_path))
    assert main(['--only', 'memory', 'million', '--output', str(tmp_path / 'out')]) == 0
    written = json.loads((tmp_path / 'out' / 'benchmark.json').read_text())['measurements']
    found = {item['name']: item for item in written}
    assert found['max_keyframes 60: kept of 300']['value'] == 60
    assert found['max_keyframes 60: forgotten']['value'] == 240
    assert 0.9 < found['max_database_mb 6: kept of 300']['ratio'] <= 1
    assert found['two-stage place found, 900 rows']['value'] == 1
    assert found['insertion up to row 600, median']['value'] > 0
    assert {file.name for file in tmp_path.iterdir()} == {'out'}


def test_no_room_for_a_million_is_logged(caplog, monkeypatch):
    caplog.set_level('INFO')
    monkeypatch.setattr(memory, '_MILLION', 10**12)
    assert list(memory.measure_million(None)) == []
    assert 'set TMPDIR' in caplog.text


def test_failing_process_is_named():
    with pytest.raises(PlaceRecognitionError, match=r'database of 5 images: .*rows_folder /none'):
        fill_alone(FillTask(5, folder='/none'))


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


@pytest.mark.parametrize('kind', [World, LargeWorld])
def test_world_is_the_same_in_any_order_and_clustered(kind):
    world, again = kind(1000), kind(1000)
    late = again.row(7)
    rows = np.stack([world.row(number) for number in range(10)])
    assert np.array_equal(rows[7], late)
    alike = rows @ rows.T
    assert alike[0, 1:5].min() > alike[0, 5:].max() > 0.1
    assert world.query(0).shape == (25, 4096)
    assert sum(world.shows(0, row) for row in range(1000)) == 5


def test_each_run_is_timed():
    calls = []
    assert len(each_milliseconds(lambda: calls.append(0), 3)) == len(calls) == 3
