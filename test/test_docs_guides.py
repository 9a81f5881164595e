"""The guides that begin with no file from another page; all but two are marked ``pytest.mark.long``.

A file is what the processes of a test run share out: these pages run beside those of test_docs_commands.py.
"""

from test_docs_commands import GUIDES, running

test_the_commands_of_a_guide_run = running(GUIDES)
