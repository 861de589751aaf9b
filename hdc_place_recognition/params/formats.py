# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Converts parameters from and to YAML files, command-line flags and a Markdown table."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
import textwrap
from typing import Any

from hdc_place_recognition.bounded_files import read_yaml
from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.table import Params, spec
from hdc_place_recognition.results import CANDIDATE_FIELDS
import yaml

NODE_NAME = 'place_recognition_node'
_FILE_BYTES = 2**18  # a file with all parameters and comments has 8 KB
_ROS_TYPES = {'f': 'float', 'i': 'int', 'u': 'uint'}
# Sections of a ROS parameter file that apply to the node; later sections override earlier ones.
_SECTIONS = ('/**', NODE_NAME, f'/{NODE_NAME}')
# Parameters of every ROS node; they are allowed in a file and ignored here.
_ROS_PARAMETERS = ('use_sim_time', 'qos_overrides', 'start_type_description_service')


def load_yaml(path: Path) -> dict[str, object]:
    """
    Read the parameters of the node from a ROS 2 parameter file.

    :param path: file in the format of `ros2 run ... --params-file`.
    :return: values by parameter name, not checked.
    :raises PlaceRecognitionError: the file is missing, is not YAML, or has no section for the
        node.
    """
    content = _read(path)
    found = [name for name in _SECTIONS if name in content]
    if not found:
        raise PlaceRecognitionError(
            f'parameter file {path} has no section {" or ".join(_SECTIONS[:2])}; '
            f'it has {", ".join(map(str, content)) or "nothing"}'
        )
    merged: dict[str, object] = {}
    for name in found:
        merged |= _section(path, name, content[name])
    return {
        name: value
        for name, value in merged.items()
        if name.partition('.')[0] not in _ROS_PARAMETERS
    }


def _read(path: Path) -> Mapping[str, Any]:
    """Return the sections of a parameter file."""
    content = read_yaml(path, _FILE_BYTES, 'parameter file')
    if not isinstance(content, Mapping):
        raise PlaceRecognitionError(
            f'parameter file {path} has no sections; expected {_SECTIONS[0]}: ros__parameters:'
        )
    return content


def _section(path: Path, name: str, section: object) -> Mapping[str, object]:
    """Return the values of one section of a parameter file."""
    values = section.get('ros__parameters') if isinstance(section, Mapping) else None
    if not isinstance(values, Mapping):
        raise PlaceRecognitionError(
            f'parameter file {path}: section {name} has no mapping ros__parameters'
        )
    return values


def dump_yaml(params: Params) -> str:
    """Return the text of a parameter file with a comment for each parameter."""
    lines = ['/**:', '  ros__parameters:']
    for item in fields(params):
        lines += [f'    # {line}' for line in textwrap.wrap(_sentence(item), 90)]
        lines.append(f'    {item.name}: {_scalar(getattr(params, item.name))}')
    return '\n'.join(lines) + '\n'


def _scalar(value: object) -> str:
    """Return a value as YAML."""
    # safe_dump adds a second line ('...') after a scalar.
    return str(yaml.safe_dump(value)).splitlines()[0]


def _sentence(item: Any) -> str:
    """Return the description of a parameter with unit, range and whether it is live."""
    about = spec(item)
    facts = [about.unit, about.allowed(), 'live' if about.live else 'fixed at start']
    return f'{about.doc} ({"; ".join(fact for fact in facts if fact)})'


def markdown_table() -> str:
    """Return the Markdown table of all parameters."""
    rows = [
        '| parameter | default | description | range or choices | live |',
        '| --- | --- | --- | --- | --- |',
    ]
    for item in fields(Params):
        about = spec(item)
        unit = f' {about.unit}' if about.unit else ''
        rows.append(
            f'| `{item.name}` | {_scalar(item.default)}{unit} | {about.doc} '
            f'| {about.allowed()} | {"yes" if about.live else ""} |'
        )
    return '\n'.join(rows) + '\n'


def candidate_fields_table() -> str:
    """Return the table of the fields of a candidate in doc/topics.md."""
    rows = ['| field | type | content |', '| --- | --- | --- |']
    for column in CANDIDATE_FIELDS:
        kind = _ROS_TYPES[column.dtype[0]] + str(8 * int(column.dtype[1]))
        rows.append(f'| `{column.name}` | {kind} | {column.doc} |')
    return '\n'.join(rows) + '\n'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add `--params-file` and one flag per parameter; the flags have no argparse defaults."""
    parser.add_argument(
        '--params-file', type=Path, metavar='YAML', help='parameter file in the format of the node'
    )
    group = parser.add_argument_group('parameters (default < file < flag)')
    for item in fields(Params):
        kind: dict[str, Any] = {'type': type(item.default), 'metavar': 'X'}
        if isinstance(item.default, bool):
            kind = {'action': argparse.BooleanOptionalAction}
        help_text = f'{_sentence(item)} [{_scalar(item.default)}]'.replace('%', '%%')
        group.add_argument(
            f'--{item.name.replace("_", "-")}',
            dest=item.name,
            default=argparse.SUPPRESS,
            help=help_text,
            **kind,
        )


def from_arguments(arguments: argparse.Namespace) -> Params:
    """
    Return the parameters of a command line; flags override the file, the file the defaults.

    :raises PlaceRecognitionError: see :func:`load_yaml` and :meth:`Params.from_dict`.
    """
    values = load_yaml(arguments.params_file) if arguments.params_file else {}
    given = {
        item.name: getattr(arguments, item.name)
        for item in fields(Params)
        if hasattr(arguments, item.name)
    }
    return Params.from_dict(values | given)
