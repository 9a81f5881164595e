"""Which changes of the core no test notices: operators, constants and conditions are changed one at a time.

    python benchmark/mutants.py map -- test -m 'not long'          # once: which tests run each line (needs coverage)
    python benchmark/mutants.py run --seed 1 --count 200           # then: each mutant against the tests of its line
    python benchmark/mutants.py run --seed 1 --count 20 --below swath_sysid/common

The seed draws the same mutants whatever the map says. A mutant is caught when a test fails or runs on until the time is
over. Compiled functions are left out, unless NUMBA_DISABLE_JIT is set for both commands.
"""

import argparse
import ast
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ROOMS = tuple(ROOT / 'swath_sysid' / name for name in ('common', 'attitude', 'pipeline'))
#: s a mutant; its tests, the quickest first, may take half of it without the change
SECONDS = 60.0
OTHER = {
    **{ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult, ast.Mod: ast.Mult},
    **{ast.FloorDiv: ast.Div, ast.And: ast.Or, ast.Or: ast.And, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq},
    **{ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Is: ast.IsNot, ast.IsNot: ast.Is},
    **{ast.In: ast.NotIn, ast.NotIn: ast.In},
}


class CoverageMap:
    """A plugin of pytest that writes which tests run each line, and how long each takes."""

    def __init__(self, path):
        import coverage

        self._path, self._took = path, {}
        self._coverage = coverage.Coverage(data_file=None, include=[f'{room}/*' for room in ROOMS])
        self._coverage.start()

    def pytest_runtest_logstart(self, nodeid):
        self._coverage.switch_context(nodeid)
        self._took[nodeid] = time.monotonic()

    def pytest_runtest_logfinish(self, nodeid):
        self._coverage.switch_context('')
        self._took[nodeid] = time.monotonic() - self._took[nodeid]

    def pytest_sessionfinish(self):
        self._coverage.stop()
        data, number = self._coverage.get_data(), {name: k for k, name in enumerate(self._took)}
        lines = {
            str(Path(file).relative_to(ROOT)): {
                line: sorted(number[name] for name in names if name)
                for line, names in data.contexts_by_lineno(file).items()
            }
            for file in data.measured_files()
        }
        self._path.parent.mkdir(exist_ok=True)
        self._path.write_text(json.dumps({'tests': list(self._took.items()), 'lines': lines}))


def changed(node):
    """The node with another operator, constant or condition, or None if it has none of them."""
    match node:
        case ast.BinOp(left, op, right) if type(op) in OTHER:
            return ast.BinOp(left, OTHER[type(op)](), right)
        case ast.BoolOp(op, values):
            return ast.BoolOp(OTHER[type(op)](), values)
        case ast.Compare(left, [op], others):
            return ast.Compare(left, [OTHER[type(op)]()], others)
        case ast.UnaryOp(ast.Not(), operand):
            return operand
        case ast.Constant(bool() as value):
            return ast.Constant(not value)
        case ast.Constant(int() | float() as value):
            return ast.Constant(value + 1 if isinstance(value, int) else 1.5 * value or 1.0)
    return None


def mutants_of(path):
    """Line, end and text of each change to a function of a module: ``(line, column, last line, its column, text)``."""
    found = {}
    functions = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.FunctionDef)]
    is_compiled = 'NUMBA_DISABLE_JIT' not in os.environ
    for function in functions:
        if is_compiled and any('accelerated' in ast.unparse(each) for each in function.decorator_list):
            continue
        for statement in function.body:
            nodes = list(ast.walk(statement))
            # Python 3.11 does not say where in a formatted text they are; a pattern takes no parentheses
            where = [node for node in nodes if isinstance(node, ast.JoinedStr | ast.pattern)]
            skipped = {id(node) for place in where for node in ast.walk(place)}
            for node in nodes:
                if id(node) in skipped:
                    continue
                conditions = [node.test] if isinstance(node, ast.If | ast.While | ast.IfExp) else []
                pairs = [(each, ast.UnaryOp(ast.Not(), each)) for each in conditions] + [(node, changed(node))]
                for old, new in pairs:
                    if new is not None:
                        text = f'({ast.unparse(ast.fix_missing_locations(new))})'
                        found[old.lineno, old.col_offset, old.end_lineno, old.end_col_offset, text] = None
    return list(found)


def with_change(source, mutant):
    """The source with one change in it; its lines keep their numbers, up to the change."""
    line, column, last, last_column, text = mutant
    lines = source.encode().splitlines(keepends=True)
    lines[line - 1 : last] = [lines[line - 1][:column] + text.encode() + lines[last - 1][last_column:]]
    return b''.join(lines).decode()


def quickest(numbers, tests):
    """The tests of a line that take half of the time together, the quickest first."""
    left, chosen = 0.5 * SECONDS, []
    for name, seconds in sorted((tests[k] for k in numbers), key=lambda test: test[1]):
        left -= seconds
        if left < 0.0 and chosen:
            break
        chosen.append(name)
    return chosen


def is_caught(folder, names):
    """Whether a test of these fails in the folder or does not come to an end."""
    environment = os.environ | {'PYTHONPATH': str(folder), 'PYTHONDONTWRITEBYTECODE': '1'}
    command = [sys.executable, '-m', 'pytest', '-qx', '-p', 'no:cacheprovider', *names]
    try:
        done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, timeout=SECONDS)
    except subprocess.TimeoutExpired:
        return True
    return done.returncode != 0


def run(given):
    """Print each mutant of a sample with what became of it, and the counts."""
    known = json.loads(given.map.read_text())
    below = [ROOT / given.below] if given.below else ROOMS
    paths = sorted(path for room in below for path in ([room] if room.is_file() else room.rglob('*.py')))
    every = [(path.relative_to(ROOT), mutant) for path in paths for mutant in mutants_of(path)]
    drawn = random.Random(given.seed).sample(every, min(given.count, len(every)))
    counts = defaultdict(int)
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made) / 'checkout'
        shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns('.venv', '.git', 'build', 'out', '__pycache__'))
        for path, mutant in drawn:
            source = (ROOT / path).read_text()
            names = quickest(known['lines'].get(str(path), {}).get(str(mutant[0]), []), known['tests'])
            (folder / path).write_text(with_change(source, mutant))
            became = ('caught' if is_caught(folder, names) else 'survived') if names else 'not reached'
            (folder / path).write_text(source)
            counts[became] += 1
            line = source.splitlines()[mutant[0] - 1].strip()
            print(f'{became:11s} {path}:{mutant[0]}  {line}  ->  {mutant[4]}', flush=True)
    print(f'{len(drawn)} of {len(every)} mutants: ' + ', '.join(f'{n} {became}' for became, n in counts.items()))
    return 0


def main():
    """Write the map of the tests, or try mutants."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('verb', nargs='?', choices=('map', 'run'))
    parser.add_argument('--map', type=Path, default=ROOT / 'out' / 'tests_of_lines.json')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--count', type=int, default=200)
    parser.add_argument('--below', help='a folder or module of the core; its rooms by default')
    at = sys.argv.index('--') if '--' in sys.argv else len(sys.argv)
    given = parser.parse_args(sys.argv[1:at])
    if given.verb == 'run':
        return run(given)
    if given.verb == 'map':
        import pytest

        return pytest.main(['-q', *sys.argv[at + 1 :]], plugins=[CoverageMap(given.map)])
    parser.print_help()
    return 0


if __name__ == '__main__':
    sys.exit(main())
