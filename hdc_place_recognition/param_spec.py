# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""What is said of one parameter, and whether a value is allowed."""

from __future__ import annotations

from dataclasses import dataclass, Field, field
import math
from typing import Any, TypeVar

from hdc_place_recognition.errors import PlaceRecognitionError

Value = bool | int | float | str
Default = TypeVar('Default', bool, int, float, str)


@dataclass(frozen=True)
class Spec:
    """What is known of a parameter besides its name, default and type."""

    doc: str
    unit: str = ''
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    live: bool = False

    def allowed(self) -> str:
        """Return the range or the choices in words, '' if anything of the type will do."""
        if self.choices:
            return ', '.join(self.choices)
        return '' if self.low is None else f'{self.low:g} to {self.high:g}'


def param(default: Default, doc: str, **details: Any) -> Default:
    """Return a field of the table; the details are those of :class:`Spec`."""
    parameter: Default = field(default=default, metadata={'spec': Spec(doc, **details)})
    return parameter


def spec(item: Field[Any]) -> Spec:
    """Return what the table says of one field of :class:`Params`."""
    found: Spec = item.metadata['spec']
    return found


def coerce(item: Field[Any], value: object) -> object:
    """Return `value`, as a float where an integer stands for one (ROS users type 1 for 1.0)."""
    if type(item.default) is float and type(value) is int:
        return float(value)
    return value


def check(item: Field[Any], value: object) -> None:
    """Raise the error that names parameter, value and remedy, if there is one."""
    kind, allowed = type(item.default), spec(item).allowed()
    of_range = f' ({allowed})' if allowed else ''
    if type(value) is not kind:
        raise PlaceRecognitionError(
            f'parameter {item.name}: {value!r} is a {type(value).__name__}, '
            f'expected a {kind.__name__}{of_range}'
        )
    if not _within(spec(item), value):
        raise PlaceRecognitionError(
            f'parameter {item.name}: {value!r} is not one of {allowed}'
            if spec(item).choices
            else f'parameter {item.name}: {value!r} is outside {allowed}'
        )


def _within(limits: Spec, value: object) -> bool:
    if limits.choices:
        return value in limits.choices
    if limits.low is None or limits.high is None or not isinstance(value, int | float):
        return True
    return math.isfinite(value) and limits.low <= value <= limits.high
