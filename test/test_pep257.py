# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The docstring linter of ament."""

from conftest import ROOT
import pytest


@pytest.mark.linter
@pytest.mark.pep257
def test_pep257():
    pep257 = pytest.importorskip('ament_pep257.main', reason='needs ament_pep257')
    assert (
        pep257.main(
            argv=[
                str(ROOT / part)
                for part in ('hdc_place_recognition', 'test', 'launch', 'setup.py')
            ]
        )
        == 0
    )
