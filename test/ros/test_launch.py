# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The launch file and what the package ships."""

import importlib.util
import re
from xml.etree import ElementTree

from conftest import ROOT
import pytest


def test_launch_file_describes_its_arguments():
    pytest.importorskip('launch', reason='needs ros2 launch')
    pytest.importorskip('launch_ros', reason='needs ros2 launch')
    path = ROOT / 'launch' / 'place_recognition.launch.py'
    spec = importlib.util.spec_from_file_location('place_recognition_launch', path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    entities = module.generate_launch_description().entities
    arguments = {entity.name: entity for entity in entities if hasattr(entity, 'default_value')}
    assert {'namespace', 'use_sim_time', 'params_file', 'image', 'log_level'} <= set(arguments)
    assert all(argument.description for argument in arguments.values())


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
