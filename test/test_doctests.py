# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The examples in the docstrings run, and print what they say."""

from __future__ import annotations

import doctest
import importlib

from conftest import ROOT
import pytest

PACKAGE = ROOT / 'hdc_place_recognition'
ROOMS = ('hdc', 'features', 'database', 'verification', 'recognition')
PATHS = [path for folder in ('.', *ROOMS) for path in sorted((PACKAGE / folder).glob('*.py'))]
MODULES = [
    '.'.join(path.relative_to(ROOT).with_suffix('').parts).removesuffix('.__init__')
    for path in PATHS
]
# Lines of examples; if fewer are found, examples were lost or are not run.
LEAST = 15


@pytest.mark.parametrize('name', MODULES)
def test_examples_print_what_they_say(name: str) -> None:
    module = importlib.import_module(name)
    assert doctest.testmod(module).failed == 0


def test_examples_are_found() -> None:
    finder = doctest.DocTestFinder(exclude_empty=True)
    found = [
        example
        for name in MODULES
        for test in finder.find(importlib.import_module(name))
        for example in test.examples
    ]
    assert len(found) >= LEAST
