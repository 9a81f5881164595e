"""``python -m swath_sysid.nodes NAME``: one node, without the checks of ``swath-sysid run``."""

import sys
from importlib import import_module

from swath_sysid.nodes.executor_loop import run

if len(sys.argv) < 2:
    sys.exit('name the module of a node, such as predictor: python -m swath_sysid.nodes predictor')
sys.exit(run(import_module(f'swath_sysid.nodes.{sys.argv[1]}').PLAN))
