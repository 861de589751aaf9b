# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The table of parameters as YAML, as command-line flags and as a README table."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
import textwrap
from typing import Any

from hdc_place_recognition.errors import PlaceRecognitionError
from hdc_place_recognition.params.table import Params, spec
import yaml

NODE_NAME = 'place_recognition_node'
# Sections of a ROS parameter file that speak to our node, the later ones winning.
_SECTIONS = ('/**', NODE_NAME, f'/{NODE_NAME}')
# Parameters that every ROS node has; a file may set them, the recognizer has no use for them.
_OF_ROS = ('use_sim_time', 'qos_overrides', 'start_type_description_service')


def load_yaml(path: Path) -> dict[str, object]:
    """
    Return the parameters that a ROS 2 parameter file sets for the node.

    :param path: the file that `ros2 run ... --params-file` takes.
    :raises PlaceRecognitionError: the file is missing, no YAML, or has no section for the node.
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
    return {name: value for name, value in merged.items() if name.partition('.')[0] not in _OF_ROS}


def _read(path: Path) -> Mapping[str, Any]:
    try:
        content = yaml.safe_load(path.read_text(encoding='utf-8'))
    except OSError as error:
        raise PlaceRecognitionError(f'parameter file {path}: {error.strerror}') from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        where = ' '.join(str(error).split())
        raise PlaceRecognitionError(f'parameter file {path} is no YAML: {where}') from error
    if not isinstance(content, Mapping):
        raise PlaceRecognitionError(
            f'parameter file {path} holds no sections; expected {_SECTIONS[0]}: ros__parameters:'
        )
    return content


def _section(path: Path, name: str, section: object) -> Mapping[str, object]:
    values = section.get('ros__parameters') if isinstance(section, Mapping) else None
    if not isinstance(values, Mapping):
        raise PlaceRecognitionError(
            f'parameter file {path}: section {name} has no mapping ros__parameters'
        )
    return values


def dump_yaml(params: Params) -> str:
    """Return a parameter file, with a comment for each, that repeats `params`."""
    lines = ['/**:', '  ros__parameters:']
    for item in fields(params):
        lines += [f'    # {line}' for line in textwrap.wrap(_sentence(item), 90)]
        lines.append(f'    {item.name}: {_scalar(getattr(params, item.name))}')
    return '\n'.join(lines) + '\n'


def _scalar(value: object) -> str:
    # The first line only: a bare scalar is followed by an end-of-document line.
    return str(yaml.safe_dump(value)).splitlines()[0]


def _sentence(item: Any) -> str:
    about = spec(item)
    facts = [about.unit, about.allowed(), 'live' if about.live else 'fixed at start']
    return f'{about.doc} ({"; ".join(fact for fact in facts if fact)})'


def markdown_table() -> str:
    """Return README's table of parameters."""
    rows = [
        '| parameter | default | what it is | range or choices | live |',
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


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add `--params-file` and a flag for each parameter, without defaults."""
    parser.add_argument(
        '--params-file', type=Path, metavar='YAML', help='parameter file, the same as for the node'
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
    Return the parameters of a command line: defaults, then the file, then the flags.

    :raises PlaceRecognitionError: as :func:`load_yaml` and :meth:`Params.from_dict`.
    """
    values = load_yaml(arguments.params_file) if arguments.params_file else {}
    given = {
        item.name: getattr(arguments, item.name)
        for item in fields(Params)
        if hasattr(arguments, item.name)
    }
    return Params.from_dict(values | given)
