# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The launch file and what the package ships."""

from __future__ import annotations

import importlib.util
import re
import sys
from types import ModuleType, SimpleNamespace
from typing import Any
from xml.etree import ElementTree

from conftest import ROOT
from hdc_place_recognition.params.formats import load_yaml
from hdc_place_recognition.params.table import Params
import pytest

# Names that the launch file uses; ros2 launch is not on PyPI.
NAMES = {
    'launch': ('LaunchContext', 'LaunchDescription'),
    'launch.actions': ('DeclareLaunchArgument', 'OpaqueFunction'),
    'launch.substitutions': ('LaunchConfiguration',),
    'launch_ros': (),
    'launch_ros.actions': ('Node',),
    'launch_ros.parameter_descriptions': ('ParameterValue',),
}


class Recorded(SimpleNamespace):
    """Stands for a class of launch: remembers the arguments that it was made with."""

    def __init__(self, *positional: Any, **named: Any) -> None:
        super().__init__(positional=positional, **named)
        self.name = named.get('name', positional[0] if positional else None)


@pytest.fixture
def launch_file(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return the launch file as a module, with stand-ins if launch is not installed."""
    if importlib.util.find_spec('launch_ros') is None:
        for module, names in NAMES.items():
            stand_in = ModuleType(module)
            vars(stand_in).update(dict.fromkeys(names, Recorded))
            monkeypatch.setitem(sys.modules, module, stand_in)
    path = ROOT / 'launch' / 'place_recognition.launch.py'
    spec = importlib.util.spec_from_file_location('place_recognition_launch', path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def options(launch_file: ModuleType, **given: str) -> dict[str, Any]:
    """Return the arguments of the node for launch arguments."""
    values = {name: default for name, (default, _) in launch_file.ARGUMENTS.items()}
    return launch_file.options({**values, **dict.fromkeys(vars(Params()), ''), **given})


def test_launch_file_describes_its_arguments(launch_file):
    description = launch_file.generate_launch_description()
    entities = getattr(description, 'entities', None) or description.positional[0]
    arguments = {entity.name: entity for entity in entities if hasattr(entity, 'default_value')}
    assert {'namespace', 'use_sim_time', 'params_file', 'image', 'log_level'} <= set(arguments)
    assert {'name', 'respawn', 'image_qos', 'image_transport', 'min_score'} <= set(arguments)
    assert all(argument.description for argument in arguments.values())


def test_nothing_is_overridden_by_default(launch_file):
    found = options(launch_file)
    assert found['parameters'] == [] and found['remappings'] == []
    assert found['name'] == 'place_recognition_node' and found['respawn'] is False


def test_single_parameters_are_arguments_after_the_file(launch_file):
    found = options(
        launch_file,
        params_file='my.yaml',
        min_score='1',
        top_k='3',
        verify='False',
        use_sim_time='true',
        image='/camera/image_raw',
        respawn='true',
    )
    given = {'use_sim_time': True, 'top_k': 3, 'verify': False, 'min_score': 1.0}
    assert found['parameters'] == ['my.yaml', given]
    assert type(found['parameters'][1]['min_score']) is float
    assert found['remappings'] == [('image', '/camera/image_raw')] and found['respawn'] is True


def test_text_stays_text(launch_file):
    (given,) = options(launch_file, rows_folder='5')['parameters']
    assert isinstance(given['rows_folder'], launch_file.ParameterValue)


def test_a_value_of_the_wrong_type_is_named(launch_file):
    with pytest.raises(ValueError, match="min_score: 'high' is no float"):
        options(launch_file, min_score='high')


def test_the_shipped_file_is_an_example_with_the_defaults():
    values = load_yaml(ROOT / 'config' / 'place_recognition.yaml')
    assert Params.from_dict(values) == Params()


def test_versions_and_license_agree():
    package = ElementTree.parse(ROOT / 'package.xml').getroot()
    setup = (ROOT / 'setup.py').read_text()
    assert package.get('format') == '3'
    assert f"version='{package.findtext('version')}'" in setup
    assert f"license='{package.findtext('license')}'" in setup


def test_every_executable_exists():
    setup = (ROOT / 'setup.py').read_text()
    scripts = re.findall(r"'(\w+) = ([\w.]+):(\w+)'", setup)
    assert {'place_recognition_node', 'hdc_evaluate', 'hdc_demo', 'hdc_params'} <= {
        name for name, _, _ in scripts
    }
    for _, module, function in scripts:
        source = ROOT.joinpath(*module.split('.')).with_suffix('.py')
        assert f'def {function}(' in source.read_text()
