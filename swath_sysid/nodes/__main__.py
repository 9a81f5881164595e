"""``python -m swath_sysid.nodes NAME``: one node, without the checks of ``swath-sysid run``."""

import sys
from importlib import import_module
from importlib.util import find_spec

from swath_sysid.nodes.executor_loop import run
from swath_sysid.nodes.parameters.table import node_module

if len(sys.argv) < 2:
    sys.exit('name the module of a node, such as predictor: python -m swath_sysid.nodes predictor')
name = node_module(sys.argv[1])
is_module = sys.argv[1].isidentifier() and find_spec(name) is not None
plan = getattr(import_module(name), 'PLAN', None) if is_module else None
if plan is None:
    sys.exit(f"there is no node '{sys.argv[1]}': name the module of one, such as predictor")
sys.exit(run(plan))
