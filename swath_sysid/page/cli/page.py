"""``swath-sysid page``: what the nodes do, and a guided bring-up, in a browser."""

import os
import secrets
import sys
from argparse import Namespace
from contextlib import ExitStack
from pathlib import Path
from urllib.parse import urlsplit

from swath_sysid.cli.ros import ros_needed
from swath_sysid.cli.run import remappings
from swath_sysid.common.errors import InputError
from swath_sysid.common.processes import NICENESS
from swath_sysid.page.server import LOCAL_NAMES, check_installed, served


def run(arguments: Namespace) -> int:
    """Serve the page until a signal comes; returns the exit code."""
    check_installed()
    with ros_needed():
        from swath_sysid.nodes.executor_loop import events_executor
        from swath_sysid.nodes.executor_loop import run as run_nodes
        from swath_sysid.page.nodes.page_node import PageNode
    from swath_sysid.page.state import PageState

    folder = Path(arguments.output)
    if not folder.is_dir() or not os.access(folder, os.W_OK):
        raise InputError(f'nothing can be saved in --output {folder}: choose a folder that exists and is writable')
    origin = origin_of(arguments.origin)
    token = token_for(origin or arguments.host, arguments.token or os.environ.get('SWATH_SYSID_TOKEN', ''))
    # where the processor is short the nodes come first
    os.nice(NICENESS)
    address = '127.0.0.1' if arguments.host == 'localhost' else arguments.host
    with ExitStack() as serving:

        def make_node() -> PageNode:
            node = PageNode(lambda line: state.answer(line))
            state = PageState(node, folder, arguments.axis, getattr(arguments, 'manifest', None))
            url = serving.enter_context(served(state, address, arguments.port, token, origin))
            print(f'the page is at {url}', file=sys.stderr, flush=True)
            return node

        return run_nodes([(events_executor, [make_node])], ['swath-sysid', '--ros-args', *remappings(arguments)])


def token_for(host: str, given: str) -> str:
    """The token that is asked for: none on this machine only, unless one is given."""
    return given or ('' if host in LOCAL_NAMES else secrets.token_urlsafe(12))


def origin_of(given: str | None) -> str:
    """The address at which browsers reach the page through a proxy; empty without one."""
    parts = urlsplit(given or '')
    if given and (parts.scheme not in ('http', 'https') or not parts.hostname or parts.query or parts.fragment):
        raise InputError(f'--origin {given} is no address: give what browsers open, as in https://boat.example/craft1/')
    return given or ''
