# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
Change the code in one place at a time, and count how often a test notices.

    .venv/bin/python test/mutants.py --count 20 --room database

A mutant is a copy of the package in which one comparison, operator or constant is different. It is
killed if a test fails, or if the tests take too long. A mutant that survives is a missing test,
or harmless: the change makes the code slower, or makes no difference. The working tree is never
changed; all runs happen in a temporary copy.
"""

from __future__ import annotations

import argparse
import ast
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import os
from pathlib import Path
from random import Random
import re
import shutil
import subprocess
import sys
from tempfile import TemporaryDirectory
from time import perf_counter

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = 'hdc_place_recognition'
ROOMS = ('hdc', 'features', 'database', 'verification', 'recognition')
# The tests read these, besides the package.
COPIED = (PACKAGE, 'test', 'config', 'launch', 'pyproject.toml')
# What each operator may become, as written in the source.
OPERATORS: dict[type[ast.AST], tuple[str, tuple[str, ...]]] = {
    ast.Lt: ('<', ('<=', '>')),
    ast.LtE: ('<=', ('<', '>=')),
    ast.Gt: ('>', ('>=', '<')),
    ast.GtE: ('>=', ('>', '<=')),
    ast.Eq: ('==', ('!=',)),
    ast.NotEq: ('!=', ('==',)),
    ast.Is: ('is', ('is not',)),
    ast.IsNot: ('is not', ('is',)),
    ast.In: ('in', ('not in',)),
    ast.NotIn: ('not in', ('in',)),
    ast.And: ('and', ('or',)),
    ast.Or: ('or', ('and',)),
    ast.Add: ('+', ('-',)),
    ast.Sub: ('-', ('+',)),
    ast.Mult: ('*', ('/',)),
    ast.Div: ('/', ('*',)),
    ast.FloorDiv: ('//', ('*',)),
    ast.Mod: ('%', ('*',)),
    ast.Pow: ('**', ('*',)),
    ast.LShift: ('<<', ('>>',)),
    ast.RShift: ('>>', ('<<',)),
    ast.BitAnd: ('&', ('|',)),
    ast.BitOr: ('|', ('&',)),
}
UNARY = {ast.Not: 'not ', ast.USub: '-', ast.Invert: '~'}
LOG_METHODS = {'debug', 'info', 'warning', 'error', 'exception', 'warn'}
# A run may take this many times as long as that of the unchanged package, and this much longer.
PATIENCE, GRACE_S = 3.0, 20.0


@dataclass(frozen=True)
class Mutant:
    """
    One change of one file.

    :param path: of the file, relative to the root.
    :param original: content of the file.
    :param start: first byte that is replaced.
    :param end: byte after the last one that is replaced.
    :param text: replacement.
    """

    path: Path
    original: bytes
    start: int
    end: int
    text: str

    @property
    def changed(self) -> bytes:
        """Return the content of the changed file."""
        start, end = self.start, self.end
        return self.original[:start] + self.text.encode() + self.original[end:]

    def __str__(self) -> str:
        """Return file, line, and the line before and after."""
        index = self.original.count(b'\n', 0, self.start)
        before, after = (
            content.splitlines()[index].strip().decode()
            for content in (self.original, self.changed)
        )
        return f'{self.path}:{index + 1}\n    - {before}\n    + {after}'


class MutantFinder(ast.NodeVisitor):
    """
    Finds every mutant of a file, in functions, constants and default values.

    Leaves out type hints, docstrings, texts, error and log messages, decorators and __repr__.

    :param path: of the file, relative to the root.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._source = (ROOT / path).read_bytes()
        lines = self._source.splitlines(keepends=True)
        self._line_starts = [sum(map(len, lines[:number])) for number in range(len(lines))]
        self._in_function = False
        # The mutants of each place, which has an equal chance.
        self.places: list[list[Mutant]] = []
        self.visit(ast.parse(self._source))

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        """Visit default values and body, without type hints and decorators."""
        if node.name == '__repr__':
            return
        self._visit_all([*node.args.defaults, *filter(None, node.args.kw_defaults)])
        outside, self._in_function = self._in_function, True
        self._visit_all(node.body)
        self._in_function = outside

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        """Visit the body only; a protocol is never executed."""
        if not any(isinstance(base, ast.Name) and base.id == 'Protocol' for base in node.bases):
            self._visit_all(node.body)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        """Visit the value, without the type hint."""
        if node.value is not None:
            self.visit(node.value)

    def visit_Raise(self, node: ast.Raise) -> None:
        """Leave out errors."""

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Leave out texts."""

    def visit_If(self, node: ast.If) -> None:
        """Leave out imports for type checkers."""
        if not (isinstance(node.test, ast.Name) and node.test.id == 'TYPE_CHECKING'):
            self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        """Leave out log messages and warnings."""
        if not (isinstance(node.func, ast.Attribute) and node.func.attr in LOG_METHODS):
            self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        """Change each comparison."""
        operands = [node.left, *node.comparators]
        for left, operator, right in zip(operands, node.ops, operands[1:], strict=False):
            self._change_operator(left, operator, right)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        """Change each `and` and `or`."""
        for left, right in zip(node.values, node.values[1:], strict=False):
            self._change_operator(left, node.op, right)
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        """Change the operator; a `|` outside of functions joins types."""
        if self._in_function or not isinstance(node.op, ast.BitOr):
            self._change_operator(node.left, node.op, node.right)
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        """Change the operator."""
        self._change_operator(node.target, node.op, node.value)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        """Drop the operator."""
        if type(node.op) in UNARY:
            start = self._start(node)
            self._add(start, start + len(UNARY[type(node.op)]), '')
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        """Change numbers and truth values."""
        value = node.value
        if isinstance(value, bool):
            texts = [repr(not value)]
        elif isinstance(value, int):
            texts = [repr(value + 1)] + ([repr(value - 1)] if value else [])
        elif isinstance(value, float):
            texts = [repr(value * 2), repr(value / 2)] if value else ['1.0']
        else:
            return
        self._add(self._start(node), self._end(node), *texts)

    def _visit_all(self, nodes: Sequence[ast.AST]) -> None:
        for node in nodes:
            self.visit(node)

    def _change_operator(self, left: ast.expr, operator: ast.AST, right: ast.expr) -> None:
        """Note the replacements of the operator, which stands between its operands."""
        if type(operator) not in OPERATORS:
            return
        old, texts = OPERATORS[type(operator)]
        end, start = self._end(left), self._start(right)
        between = self._source[end:start].decode()
        found = re.search(re.escape(old).replace(r'\ ', r'\s+'), between)
        if found:
            self._add(end + found.start(), end + found.end(), *texts)

    def _add(self, start: int, end: int, *texts: str) -> None:
        self.places.append([Mutant(self._path, self._source, start, end, text) for text in texts])

    def _start(self, node: ast.expr) -> int:
        return self._line_starts[node.lineno - 1] + node.col_offset

    def _end(self, node: ast.expr) -> int:
        assert node.end_lineno is not None and node.end_col_offset is not None
        return self._line_starts[node.end_lineno - 1] + node.end_col_offset


def choose(rooms: Sequence[str], count: int, seed: int) -> list[Mutant]:
    """Return random mutants of some rooms, at most one of each place, in random order."""
    random = Random(seed)
    places: list[list[Mutant]] = []
    for room in rooms:
        for path in sorted((ROOT / PACKAGE / room).glob('*.py')):
            places += MutantFinder(path.relative_to(ROOT)).places
    return [random.choice(place) for place in random.sample(places, min(count, len(places)))]


def default_tests(room: str) -> list[str]:
    """Return the tests of a room, then those of the other recognition rooms."""
    return [f'test/{name}' for name in (room, *(name for name in ROOMS if name != room))]


def passes(folder: Path, tests: Sequence[str], timeout_s: float | None = None) -> bool:
    """Return whether the tests pass in a copy of the package; False if they take too long."""
    environment = {**os.environ, 'PYTHONPATH': str(folder), 'PYTHONDONTWRITEBYTECODE': '1'}
    command = [sys.executable, '-m', 'pytest', '-x', '-q', '-p', 'no:cacheprovider', *tests]
    # A session of its own, so that processes which the tests started end with them.
    process = subprocess.Popen(
        command,
        cwd=folder,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        return process.wait(timeout_s) == 0
    except subprocess.TimeoutExpired:
        return False
    finally:
        if process.poll() is None:
            os.killpg(process.pid, 9)
            process.wait()


def run(mutants: Sequence[Mutant], tests: Sequence[str] | None) -> Iterator[tuple[Mutant, bool]]:
    """
    Yield each mutant and whether it was killed.

    :param tests: paths relative to the root; None for :func:`default_tests`.
    """
    with TemporaryDirectory() as name:
        folder = Path(name)
        for item in COPIED:
            source = ROOT / item
            copy = shutil.copytree if source.is_dir() else shutil.copy2
            copy(source, folder / item)
        start = perf_counter()
        if not passes(folder, tests or default_tests(ROOMS[0])):
            raise SystemExit('the tests fail without any change; make them pass first')
        timeout_s = PATIENCE * (perf_counter() - start) + GRACE_S
        for mutant in mutants:
            target = folder / mutant.path
            target.write_bytes(mutant.changed)
            room = mutant.path.parts[1]
            yield mutant, not passes(folder, tests or default_tests(room), timeout_s)
            target.write_bytes(mutant.original)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; the exit code is 0 whatever survives."""
    parser = argparse.ArgumentParser(description='Count the mutants that the tests notice.')
    parser.add_argument('--count', type=int, default=100, help='number of mutants')
    parser.add_argument('--seed', type=int, default=0, help='of the random choice')
    parser.add_argument(
        '--room', action='append', choices=ROOMS, help='changed room; may be given repeatedly'
    )
    parser.add_argument(
        '--tests', nargs='+', help='paths of tests; default: of the room, then of the others'
    )
    options = parser.parse_args(argv)
    mutants = choose(options.room or ROOMS, options.count, options.seed)
    survivors = []
    for mutant, killed in run(mutants, options.tests):
        print('killed  ' if killed else 'survived', mutant, flush=True)
        if not killed:
            survivors.append(mutant)
    killed_count = len(mutants) - len(survivors)
    print(f'\n{killed_count} of {len(mutants)} killed: {killed_count / max(len(mutants), 1):.0%}')
    for mutant in survivors:
        print('survived', mutant)
    return 0


if __name__ == '__main__':
    sys.exit(main())
