# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The table of parameters and its conversions."""

import argparse
from dataclasses import fields
import os
from pathlib import Path
from time import perf_counter

from conftest import ROOT
from hdc_place_recognition.cli.params import main
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.formats import (
    add_arguments,
    candidate_fields_table,
    dump_yaml,
    from_arguments,
    load_yaml,
    markdown_table,
)
from hdc_place_recognition.params.table import Params, spec
import pytest

CHANGED = Params(n_x=2, min_score=0.25, extractor='orb', center_database=False)


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def arguments(*words: str) -> Params:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return from_arguments(parser.parse_args(words))


def test_every_parameter_is_described_and_its_default_allowed():
    for item in fields(Params):
        about = spec(item)
        assert about.doc.endswith('.')
        assert about.allowed() or isinstance(item.default, bool) or item.default == '', item.name


@pytest.mark.parametrize(
    ('changes', 'message'),
    [
        ({'n_z': 1}, 'unknown parameter n_z'),
        ({'n_x': 0}, r'parameter n_x: 0 is outside 1 to 64'),
        ({'n_x': 2.0}, r'parameter n_x: 2.0 is a float, expected a int \(1 to 64\)'),
        ({'n_x': True}, 'parameter n_x: True is a bool'),
        (
            {'min_score': 'high'},
            "parameter min_score: 'high' is a str, expected a float",
        ),
        ({'min_score': float('nan')}, 'parameter min_score: nan is outside 0 to 1'),
        ({'min_score': 1.5}, 'outside 0 to 1'),
        (
            {'extractor': 'surf'},
            "parameter extractor: 'surf' is not one of efficientnet_lite0, sift",
        ),
        ({'center_database': 1}, 'parameter center_database: 1 is a int, expected a bool'),
    ],
)
def test_invalid_values_are_errors(changes, message):
    with pytest.raises(PlaceRecognitionError, match=message):
        Params.from_dict(changes)


def test_an_integer_is_accepted_for_a_float():
    changed = Params.from_dict({'min_score': 1})
    assert changed.min_score == 1.0 and type(changed.min_score) is float


def test_yaml_round_trip(tmp_path):
    for params in (Params(), CHANGED, Params(odom_tolerance_s=1e-6)):
        assert Params.from_dict(load_yaml(write(tmp_path / 'p.yaml', dump_yaml(params)))) == params


def test_the_section_of_the_node_overrides_and_ros_parameters_are_ignored(tmp_path):
    text = (
        '/**:\n  ros__parameters: {n_x: 2, n_y: 3, use_sim_time: true}\n'
        'place_recognition_node:\n  ros__parameters: {n_x: 5}\n'
        'other_node:\n  ros__parameters: {n_x: 7}\n'
    )
    assert load_yaml(write(tmp_path / 'p.yaml', text)) == {'n_x': 5, 'n_y': 3}


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('a: [1', 'is not valid YAML'),
        ('', 'has no sections'),
        (
            'other:\n  ros__parameters: {n_x: 2}',
            r'no section /\*\* or place_recognition_node; it has',
        ),
        ('/**: {n_x: 2}', 'has no mapping ros__parameters'),
    ],
)
def test_invalid_files_are_errors(tmp_path, text, message):
    with pytest.raises(PlaceRecognitionError, match=message):
        load_yaml(write(tmp_path / 'p.yaml', text))
    with pytest.raises(PlaceRecognitionError, match='No such file'):
        load_yaml(tmp_path / 'none.yaml')


def test_unknown_name_in_a_file_is_an_error(tmp_path):
    path = write(tmp_path / 'p.yaml', '/**:\n  ros__parameters: {min_similarty: 0.5}\n')
    with pytest.raises(PlaceRecognitionError, match='min_similarty'):
        arguments('--params-file', str(path))


def test_defaults_then_file_then_flags(tmp_path):
    path = str(write(tmp_path / 'p.yaml', dump_yaml(CHANGED)))
    assert arguments() == Params()
    assert arguments('--params-file', path) == CHANGED
    assert arguments('--n-x', '7', '--params-file', path) == CHANGED.replace(n_x=7)
    assert arguments('--no-center-database').center_database is False
    assert arguments('--min-score', '1').min_score == 1.0


@pytest.mark.parametrize('name', ['displacements_x', 'displacements_y'])
def test_an_even_count_of_shifts_is_refused(name):
    with pytest.raises(PlaceRecognitionError, match=f'{name}: 4 is outside 1 to 15, odd'):
        Params().replace(**{name: 4})


def test_config_file_is_up_to_date():
    assert (ROOT / 'config' / 'place_recognition.yaml').read_text() == dump_yaml(Params()), (
        'run: hdc_params --yaml > config/place_recognition.yaml'
    )


def test_documented_candidate_fields_are_up_to_date():
    assert candidate_fields_table() in (ROOT / 'doc' / 'topics.md').read_text(), (
        'paste what hdc_params --candidate-fields prints'
    )


def test_documented_table_is_up_to_date():
    assert markdown_table() in (ROOT / 'doc' / 'parameters.md').read_text(), (
        'paste what hdc_params --markdown prints'
    )


def test_command(capsys):
    assert main(['--yaml', '--n-x', '3']) == 0
    assert '    n_x: 3\n' in capsys.readouterr().out
    assert main(['--markdown']) == 0
    assert capsys.readouterr().out == markdown_table()
    assert main(['--yaml', '--n-x', '0']) == 2
    assert capsys.readouterr().err == 'hdc_params: parameter n_x: 0 is outside 1 to 64\n'


def test_extractors_of_the_table_exist():
    from hdc_place_recognition.features.registry import EXTRACTORS

    item = next(item for item in fields(Params) if item.name == 'extractor')
    assert spec(item).choices == tuple(EXTRACTORS)


EXPLODING = 'a: &a [0, 0, 0, 0, 0, 0, 0, 0]\n' + ''.join(
    f'{name}: &{name} [{", ".join(8 * ["*" + before])}]\n'
    for before, name in zip('abcdefgh', 'bcdefghi', strict=True)
)


@pytest.mark.parametrize(
    ('content', 'reason'),
    [
        (EXPLODING, 'not valid YAML: line 2 has an alias; write the value out'),
        ('[' * 100_000, 'not valid YAML: .*nest'),
        ('a: ' + '9' * 5000, 'not valid YAML'),
        ('a: ' + '1:' * 20000 + '1', 'a value of 40001 characters'),
        ('a: 2026-99-99', 'not valid YAML'),
        ('#' * 300_000, 'has 300000 bytes, more than the limit of 262144'),
    ],
    ids=['aliases', 'depth', 'digits', 'base 60', 'date', 'size'],
)
def test_a_hostile_file_is_one_line_at_once(tmp_path, content, reason):
    file = tmp_path / 'params.yaml'
    file.write_text(content)
    start = perf_counter()
    with pytest.raises(PlaceRecognitionError, match=reason) as caught:
        load_yaml(file)
    assert perf_counter() - start < 2
    assert '\n' not in str(caught.value)


def test_a_pipe_is_not_read(tmp_path):
    os.mkfifo(tmp_path / 'pipe.yaml')
    with pytest.raises(PlaceRecognitionError, match=r'pipe\.yaml is not a regular file'):
        load_yaml(tmp_path / 'pipe.yaml')
