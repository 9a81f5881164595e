"""The guides that begin with no file from another page.

A file is what the processes of a test run share out: these pages run beside those of test_docs_commands.py.
"""

from test_docs_commands import GUIDES, running

test_the_commands_of_a_guide_run = running(GUIDES)
