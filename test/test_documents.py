# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The documents: their Python blocks run, their links lead somewhere, the names they use exist."""

from __future__ import annotations

from contextlib import redirect_stdout
from dataclasses import fields
import importlib
import io
from pathlib import Path
import re
from xml.etree import ElementTree

from conftest import ROOT, texture
from hdc_place_recognition.demo.bag import write_bag
from hdc_place_recognition.params.table import Params
from hdc_place_recognition.results import Reason
import pytest

DOCUMENTS = [
    ROOT / 'README.md',
    ROOT / 'CONTRIBUTING.md',
    *sorted((ROOT / 'doc').glob('*.md')),
]
FENCED = re.compile(r'^```(\w*)\n(.*?)^```$', re.MULTILINE | re.DOTALL)
LINK = re.compile(r'\]\(([^)\s]+)\)')
NUMBER = re.compile(r'[-+]?\d+(?:\.\d+)?')
PARAMETERS = {item.name for item in fields(Params)}
# Modules of the package that the documents name, as in `hdc.algebra.bind`.
ROOMS = 'recognition|verification|database|hdc|features|results'
DOTTED = re.compile(rf'`((?:{ROOMS})(?:\.\w+)+)`')
GLOSSARY = re.findall(
    r'\w[^,]+',
    'hypervector,bind,bundle,unbind,permute,role,filler,VSA,MAP,projection,position encoding,'
    'subinterval,image descriptor,shift,keyframe,place,traverse,session,query,candidate,match,'
    'loop closure,similarity,score,inlier,vote,spread,distinctness,temporal support,evict,'
    'capacity,centering,compact keypoints,sign index,two-stage search,frame,run log,'
    'hard ground truth,soft ground truth,average precision,recall at K,recall at full precision,'
    'operating point',
)

every_document = pytest.mark.parametrize('path', DOCUMENTS, ids=lambda path: path.name)


def blocks(path: Path, *languages: str) -> list[tuple[str, str]]:
    """Return (language, text) of the fenced blocks in some languages, in order."""
    return [block for block in FENCED.findall(path.read_text()) if block[0] in languages]


def prose(path: Path) -> str:
    """Return a document without its fenced blocks."""
    return FENCED.sub('', path.read_text())


def anchors(path: Path) -> set[str]:
    """Return the anchors of the headings of a document, as GitHub makes them."""
    headings = re.findall(r'^#+ (.+)$', prose(path), re.MULTILINE)
    return {re.sub(r'[^\w\- ]', '', heading.lower()).replace(' ', '-') for heading in headings}


def assert_same_output(printed: str, expected: str) -> None:
    """Compare words exactly and numbers roughly: they depend on the versions of libraries."""
    assert NUMBER.sub('#', printed) == NUMBER.sub('#', expected)
    numbers, wanted = (
        [float(number) for number in NUMBER.findall(text)] for text in (printed, expected)
    )
    assert numbers == pytest.approx(wanted, rel=0.2, abs=0.1)


def test_python_example_prints_what_it_shows():
    namespace: dict[str, object] = {}
    printed = ''
    for language, text in blocks(ROOT / 'doc' / 'python_example.md', 'python', 'text'):
        if language == 'text':
            assert_same_output(printed, text)
            continue
        with redirect_stdout(io.StringIO()) as output:
            exec(compile(text, 'doc/python_example.md', 'exec'), namespace)
        printed = output.getvalue()


def test_readme_snippet_runs(tmp_path, monkeypatch):
    write_bag(tmp_path / 'demo_bag', laps=0.03)
    monkeypatch.chdir(tmp_path)
    images = [texture(seed, 240, 320) for seed in range(3)]
    namespace: dict[str, object] = {
        'frames': [(10**9 * index, image) for index, image in enumerate(images)],
        'image_a': images[0],
        'image_b': images[1],
    }
    snippets = blocks(ROOT / 'README.md', 'python')
    assert len(snippets) == 1
    exec(compile(snippets[0][1], 'README.md', 'exec'), namespace)


@every_document
def test_links_lead_somewhere(path):
    for link in LINK.findall(prose(path)):
        if re.match(r'https?://', link):
            continue
        name, _, anchor = link.partition('#')
        target = path.parent / name if name else path
        assert target.exists(), f'{path.name}: {link}'
        assert not anchor or anchor in anchors(target), f'{path.name}: {link}'


@every_document
def test_parameters_that_are_set_exist(path):
    inline = re.findall(r'`[^`\n]*?(\w+):=', prose(path))
    flags = re.findall(r'-p (\w+):=', path.read_text())
    assert {*inline, *flags} <= PARAMETERS, path.name


@every_document
def test_named_modules_and_functions_exist(path):
    for dotted in DOTTED.findall(prose(path)):
        parts = dotted.split('.')
        found = importlib.import_module(f'hdc_place_recognition.{parts[0]}')
        for index, part in enumerate(parts[1:], start=2):
            if not hasattr(found, part):
                importlib.import_module('.'.join(['hdc_place_recognition', *parts[:index]]))
            found = getattr(found, part)


def test_glossary_is_complete_and_sorted():
    terms = re.findall(
        r'^\*\*(.+?)\*\*:', (ROOT / 'doc' / 'glossary.md').read_text(), re.MULTILINE
    )
    assert terms == sorted(terms, key=str.lower)
    assert not set(GLOSSARY) - set(terms)


def test_readme_lists_every_room():
    rooms = [path.parent.name for path in (ROOT / 'hdc_place_recognition').glob('*/__init__.py')]
    layout = (ROOT / 'README.md').read_text().partition('## Layout')[2]
    assert not [room for room in rooms if f'`{room}/`' not in layout]


def test_citation_has_the_version_of_the_package():
    version = ElementTree.parse(ROOT / 'package.xml').getroot().findtext('version')
    assert f'\nversion: {version}\n' in (ROOT / 'CITATION.cff').read_text()


def test_reasons_are_listed_by_their_numbers():
    text = (ROOT / 'doc' / 'topics.md').read_text()
    for number, reason in enumerate(Reason):
        assert f'| {number} | `{reason.name}` |' in text
