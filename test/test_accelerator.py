"""numba that is installed and cannot be used: told, and everything works without."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FIT = """
import json, sys
import swath_sysid.attitude.identification.refit
from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.common.accelerator import has_numba, why_uncompiled
import numpy as np
early = 'numba' in sys.modules
angle, _ = simulate(hull_named('swath-pitch').model, 0.1, 0.0, np.linspace(0.0, 5.0, 50))
why = why_uncompiled()
print(json.dumps([early, has_numba(), why and [why.code, why.message], angle[-1]]))
"""


def found(environment, *paths):
    path = os.pathsep.join([*map(str, paths), str(ROOT), os.environ.get('PYTHONPATH', '')])
    given = {name: value for name, value in os.environ.items() if name != 'NUMBA_DISABLE_JIT'}
    done = subprocess.run(
        [sys.executable, '-c', FIT], env={**given, 'PYTHONPATH': path, **environment}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_numba_that_cannot_be_loaded_is_told_and_done_without(tmp_path):
    early, usable, why, plain = found({'NUMBA_DISABLE_JIT': '1'})
    assert not early and not usable
    (tmp_path / 'numba.py').write_text('raise ImportError("Numba needs NumPy 2.2\\nor less")')
    early, usable, why, angle = found({}, tmp_path)
    assert not early and not usable and angle == plain
    assert why[0] == 'numba-fails' and '(Numba needs NumPy 2.2 or less)' in why[1]


def test_numba_that_is_not_wanted_is_told():
    pytest.importorskip('numba')
    _, _, (code, message), plain = found({'NUMBA_DISABLE_JIT': '1'})
    assert code == 'numba-disabled' and 'unset it' in message
    early, usable, why, angle = found({})
    assert not early and usable and why is None and angle == pytest.approx(plain, rel=1e-9)
