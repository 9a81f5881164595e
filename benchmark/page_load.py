"""What the page costs the predictor: 200 Hz, five browsers, one of them stalled.

    python benchmark/page_load.py

The same running nodes, with the page and without it in turns: delay from the sensor's message to forecast/next, and the
predictor's processor time. Sensor and nodes keep to one core, the page's server and the browsers to the other, as if
they ran elsewhere. A browser is a websocket that takes what the server sends; the stalled one stops reading. What
counts is the ratio of neighbours: what else the machine does falls on both. Needs the extra `page`.
"""

import argparse
import asyncio
import os
import re
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path

import numpy as np
from latency import ROOT, background, delays, environment, node, percentiles, process, processor_seconds, role

BROWSERS = 5
PORT = 8585
PATIENCE = 120.0
SHOWN = 20
"""Messages after which a page is up, and the stalled one stalls."""

SETTLING = 2.0
"""s at the beginning of a turn that do not count."""

LEARNING = 40.0
"""s for the nodes to start and to learn what they go on with."""

LONGEST = 3600.0
"""s of the sensor."""


async def look(address, stalls, on_shown):
    """One browser: opens the page, says who it is, and reads for ever."""
    import websockets

    def text_at(path):
        return urllib.request.urlopen(address + path, timeout=PATIENCE).read().decode()

    entrance = await asyncio.to_thread(text_at, '')
    page = await asyncio.to_thread(text_at, re.search(r'url=/([^"]+)', entrance).group(1))
    client = re.search(r'client_id\W+([\w-]{36})', page).group(1)
    words = (
        f'EIO=4&transport=websocket&client_id={client}&implicit_handshake=true&tab_id={client}'
        f'&document_id={client}&next_message_id=0'
    )
    address = f'{address.replace("http:", "ws:")}_nicegui_ws/socket.io/?{words}'
    async with websockets.connect(address, max_queue=1, max_size=None, ping_interval=None) as socket:
        await socket.recv()
        await socket.send('40')
        count = 0
        while not (stalls and count > SHOWN):
            if await socket.recv() == '2':
                await socket.send('3')
            count += 1
            if count == SHOWN:
                on_shown()
        await asyncio.Event().wait()


async def serve_browsers(address):
    """All of them; says when every one has been shown the page."""
    shown = []

    def on_shown():
        shown.append(True)
        if len(shown) == BROWSERS:
            print('all look', flush=True)

    await asyncio.gather(*(look(address, number == 0, on_shown) for number in range(BROWSERS)))


@contextmanager
def looked_at(env, core, folder):
    """The page runs on a core, and so many browsers look at it."""
    words = [sys.executable, '-m', 'swath_sysid.start', 'page', '--port', str(PORT), '--output', folder]
    with ExitStack() as stack:
        begin = {'env': env, 'cwd': ROOT, 'preexec_fn': lambda: os.sched_setaffinity(0, {core})}
        server = subprocess.Popen(words, stderr=subprocess.DEVNULL, **begin)
        stack.callback(end, server)
        address, patience = f'http://localhost:{PORT}/', time.monotonic() + PATIENCE
        while not answers(address):
            assert time.monotonic() < patience and server.poll() is None, 'the page does not answer'
            time.sleep(0.2)
        browsers = subprocess.Popen(
            [sys.executable, __file__, '--browsers', address], stdout=subprocess.PIPE, text=True, **begin
        )
        stack.callback(end, browsers)
        assert browsers.stdout.readline() == 'all look\n', 'the browsers are not shown the page'
        yield server


def end(child):
    child.terminate()
    child.wait(PATIENCE)


def answers(address):
    try:
        return urllib.request.urlopen(address, timeout=PATIENCE).status == 200
    except (urllib.error.URLError, ConnectionError):
        return False


def measure(rate, seconds, rounds, cores):
    """The turns with and without the page, while sensor and nodes go on.

    Yields
    ------
    with_page : bool
    delay : ndarray
        Of each forecast, ms.
    lost : int
        Messages sent in this time without a forecast.
    spent : dict of str to float
        Processor time of predictor and page a second, s.
    """
    env, turns = environment(), []
    with tempfile.TemporaryDirectory() as folder:
        sent_path, arrived_path = Path(folder, 'sent.npy'), Path(folder, 'arrived.npz')
        with (
            process(*role('sink', topics=['forecast/next'], output=str(arrived_path)), environment=env),
            process(*node('imu_buffer'), environment=env),
            process(*node('identifier'), environment=env),
            process(*node('predictor'), environment=env) as predictor,
        ):
            source = background(role('source', rate=rate, seconds=LONGEST, subscribers=2, output=str(sent_path)), env)
            time.sleep(LEARNING)
            for number in range(rounds):
                # which comes first changes, so that a machine that gets busier favours neither
                for with_page in (False, True) if number % 2 == 0 else (True, False):
                    with looked_at(env, cores[-1], folder) if with_page else nullcontext() as server:
                        watched = {'predictor': predictor.pid} | ({'page': server.pid} if with_page else {})
                        time.sleep(SETTLING)
                        begun, before = time.monotonic_ns(), [processor_seconds(pid) for pid in watched.values()]
                        time.sleep(seconds)
                        spent = {
                            name: (processor_seconds(pid) - b) / seconds
                            for (name, pid), b in zip(watched.items(), before, strict=True)
                        }
                        turns.append((with_page, begun, time.monotonic_ns(), spent))
            end(source)
        sent, arrived = np.load(sent_path), np.load(arrived_path)['forecast_next']
    for with_page, begun, ended, spent in turns:
        here, there = (table[(table[:, 1] >= begun) & (table[:, 1] < ended)] for table in (sent, arrived))
        yield with_page, delays(sent, there, round(1e9 / rate)), len(here) - len(there), spent


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--rate', type=float, default=200.0)
    parser.add_argument('--seconds', type=float, default=20.0, help='of a turn')
    parser.add_argument('--rounds', type=int, default=7, help='pairs of turns')
    parser.add_argument('--browsers', help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.browsers:
        asyncio.run(serve_browsers(arguments.browsers))
        return
    try:
        import nicegui  # noqa: F401
    except ImportError as error:
        print(f'left out: {error}; pip install "swath_sysid[page]"')
        return
    cores = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {cores[0]})
    found = {True: [], False: []}
    for with_page, delay, lost, spent in measure(arguments.rate, arguments.seconds, arguments.rounds, cores):
        shares = ', '.join(f'{name} {100.0 * share:.1f} %' for name, share in spent.items())
        print(f'{"with   " if with_page else "without"}: {percentiles(delay)}  lost {lost}  processor: {shares}')
        found[with_page].append((np.median(delay), np.percentile(delay, 99)))
    ratios = np.array(found[True]) / found[False]
    median, p99 = np.median(ratios, axis=0)
    print(
        f'with the page over without, median of {len(ratios)} pairs: median delay {median:.3f} '
        f'({ratios[:, 0].min():.3f} to {ratios[:, 0].max():.3f}), p99 {p99:.3f}'
    )


if __name__ == '__main__':
    main()
