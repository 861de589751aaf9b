# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The linter of ament."""

from conftest import ROOT
import pytest


@pytest.mark.flake8
@pytest.mark.linter
def test_flake8():
    flake8 = pytest.importorskip('ament_flake8.main', reason='needs ament_flake8')
    count, errors = flake8.main_with_errors(
        argv=[str(ROOT / part) for part in ('hdc_place_recognition', 'test', 'launch', 'setup.py')]
    )
    assert count == 0, '\n'.join(errors)
