"""Which hand-chosen constants nothing notices: each is multiplied and divided by 1.5 while a command runs.

    python benchmark/constants.py swath_sysid/common/signals.py -- python -m pytest -qx test/test_common_signals.py
    python benchmark/constants.py swath_sysid/attitude/hull --only _RANGES,LEAST -- python -m pytest -qx test
    python benchmark/constants.py FILE... --score 'mean (\\S+)' -- python benchmark/default_hull.py --seeds 1

A constant is an assignment of plain numbers to a name, in a module or in a class that is no dataclass. The command runs
in a copy of the checkout; it notices a change by failing or, with --score, by a number that gets worse. Numbers that
the pattern's group finds in the output are errors: smaller is better, and more than 2 % is worse.
"""

import argparse
import ast
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FACTORS = (1.5, 1.0 / 1.5)
WORSE = 1.02
SECONDS = 1800.0  #: After which a command has failed: a search may never end.
FUNCTIONS = {'radians', 'deg2rad', 'sqrt', 'log', 'float'}


def constants_of(source):
    """Name and value's node of each constant in a module's source."""
    tree = ast.parse(source)
    places = [tree, *(node for node in ast.walk(tree) if isinstance(node, ast.ClassDef))]
    for place in places:
        if isinstance(place, ast.ClassDef) and any('dataclass' in ast.unparse(each) for each in place.decorator_list):
            continue
        for statement in place.body:
            if not isinstance(statement, ast.Assign | ast.AnnAssign) or statement.value is None:
                continue
            target = statement.targets[0] if isinstance(statement, ast.Assign) else statement.target
            pairs = [(target, statement.value)]
            if isinstance(target, ast.Tuple) and isinstance(statement.value, ast.Tuple):
                pairs = list(zip(target.elts, statement.value.elts, strict=True))
            yield from ((ast.unparse(name), value) for name, value in pairs if numbers_in(value))


def numbers_in(value):
    """The literal numbers of an expression that holds no call but of `FUNCTIONS`; empty for any other."""
    nodes = list(ast.walk(value))
    called = {ast.unparse(node.func).rpartition('.')[2] for node in nodes if isinstance(node, ast.Call)}
    if called - FUNCTIONS or any(isinstance(node, ast.Lambda | ast.comprehension) for node in nodes):
        return []
    constants = [node for node in nodes if isinstance(node, ast.Constant)]
    return [node for node in constants if isinstance(node.value, int | float) and not isinstance(node.value, bool)]


def scaled(source, value, factor):
    """The source with the numbers of one constant scaled, whole ones to whole ones; exponents stay."""
    lines = source.splitlines(keepends=True)
    exponents = {id(node.right) for node in ast.walk(value) if isinstance(node, ast.BinOp) and type(node.op) is ast.Pow}
    found = [node for node in numbers_in(value) if id(node) not in exponents]
    for node in sorted(found, key=lambda node: (node.lineno, node.col_offset), reverse=True):
        new = round(node.value * factor) if isinstance(node.value, int) else node.value * factor
        line = lines[node.lineno - 1].encode()
        lines[node.lineno - 1] = (line[: node.col_offset] + repr(new).encode() + line[node.end_col_offset :]).decode()
    return ''.join(lines)


def outcome(command, folder, pattern):
    """Whether the command succeeds in the folder, and the numbers it prints."""
    cache = {'NUMBA_CACHE_DIR': str(folder / '.numba')}
    environment = os.environ | cache | {'PYTHONPATH': str(folder), 'PYTHONDONTWRITEBYTECODE': '1'}
    try:
        done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=SECONDS)
    except subprocess.TimeoutExpired:
        return False, []
    return done.returncode == 0, [float(each) for each in re.findall(pattern, done.stdout)] if pattern else []


def main():
    """Print each constant whose change the command does not notice."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('places', nargs='*', help='modules or folders')
    parser.add_argument('--only', help='names, with commas')
    parser.add_argument('--score', help='pattern whose group is an error in the output')
    at = sys.argv.index('--') if '--' in sys.argv else len(sys.argv)
    given, command = parser.parse_args(sys.argv[1:at]), sys.argv[at + 1 :]
    if not command:
        parser.print_help()
        return 0
    if command[0] == 'python':  # the copy has no environment of its own
        command[0] = sys.executable
    modules = [
        path for place in map(Path, given.places) for path in ([place] if place.is_file() else place.rglob('*.py'))
    ]
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made) / 'checkout'
        shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns('.venv', '.git', 'build', 'out', '__pycache__'))
        passes, before = outcome(command, folder, given.score)
        if not passes:
            parser.error('the command fails without any change')
        unnoticed = total = 0
        for module in sorted(path.resolve().relative_to(ROOT) for path in modules):
            source = (ROOT / module).read_text()
            for name, value in constants_of(source):
                if given.only and name not in given.only.split(','):
                    continue
                total += 1
                for factor in FACTORS:
                    (folder / module).write_text(scaled(source, value, factor))
                    passes, after = outcome(command, folder, given.score)
                    if not passes or any(b > WORSE * a for a, b in zip(before, after, strict=False)):
                        break
                else:
                    unnoticed += 1
                    print(f'{module}:{value.lineno} {name} = {ast.unparse(value)}', flush=True)
                (folder / module).write_text(source)
    print(f'nothing notices {unnoticed} of {total} constants')
    return 0


if __name__ == '__main__':
    sys.exit(main())
