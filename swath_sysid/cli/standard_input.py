"""A record that is given as ``-``."""

import os
import shutil
import sys
import tempfile
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

STANDARD_INPUT = 'standard_input'  #: Name of the file that stands for it.


@contextmanager
def standard_input_as_file(arguments: Namespace) -> Iterator[None]:
    """While the block runs, a record given as ``-`` is a file with the content of standard input."""
    given: dict[str, Any] = {name: getattr(arguments, name, None) for name in ('record', 'trial', 'trials')}
    if not any('-' in (value if isinstance(value, list) else [value]) for value in given.values()):
        yield
        return
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, STANDARD_INPUT)
        with open(path, 'wb') as file:
            shutil.copyfileobj(sys.stdin.buffer, file)
        for name, value in given.items():
            is_list = isinstance(value, list)
            own = [path if each == '-' else each for each in (value if is_list else [value])]
            setattr(arguments, name, own if is_list else own[0])
        yield
