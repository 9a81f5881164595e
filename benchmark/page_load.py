"""What the page costs the predictor: 200 Hz, five browsers, one of them stalled.

    python benchmark/page_load.py

The same nodes, with the page and without it in turns: delay from the sensor's message to forecast/next, and the
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
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
from latency import ROOT, delays, environment, node, percentiles, process, processor_seconds, role

BROWSERS = 5
PORT = 8585
PATIENCE = 120.0
SHOWN = 20
"""Messages after which a page is up, and the stalled one stalls."""

SETTLING = 2.0
"""s at the beginning that do not count."""


async def look(address, stalls, on_shown):
    """One browser: opens the page, says who it is, and reads for ever."""
    import websockets

    page = await asyncio.to_thread(lambda: urllib.request.urlopen(address, timeout=PATIENCE).read().decode())
    client = re.search(r'client_id\W+([\w-]{36})', page).group(1)
    words = (f'EIO=4&transport=websocket&client_id={client}&implicit_handshake=true&tab_id={client}'
             f'&document_id={client}&next_message_id=0')
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
            [sys.executable, __file__, '--browsers', address], stdout=subprocess.PIPE, text=True, **begin)
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


def measure(with_page, rate, seconds, cores):
    """Delays, ms, messages lost, and processor time of predictor and page a second, s."""
    env = environment()
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        sent_path, arrived_path = Path(folder, 'sent.npy'), Path(folder, 'arrived.npz')
        with process(*role('sink', topics=['forecast/next'], output=str(arrived_path)), environment=env), \
                process(*node('imu_buffer'), environment=env), process(*node('identifier'), environment=env), \
                process(*node('predictor'), environment=env) as predictor:
            watched = [predictor]
            if with_page:
                watched.append(stack.enter_context(looked_at(env, cores[-1], folder)))
            begun = [processor_seconds(each.pid) for each in watched]
            words = role('source', rate=rate, seconds=seconds, subscribers=2 + with_page, output=str(sent_path))
            subprocess.run([sys.executable, *words], env=env, cwd=ROOT, check=True)
            spent = [(processor_seconds(each.pid) - b) / seconds for each, b in zip(watched, begun, strict=True)]
            stack.close()
        sent, arrived = np.load(sent_path), np.load(arrived_path)['forecast_next']
    found = delays(sent, arrived, round(1e9 / rate))
    return found[round(SETTLING * rate):], len(sent) - len(found), spent


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--rate', type=float, default=200.0)
    parser.add_argument('--seconds', type=float, default=20.0)
    parser.add_argument('--rounds', type=int, default=5)
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
    ratios = []
    for number in range(arguments.rounds):
        pair = {}
        # which comes first changes, so that a machine that gets busier favours neither
        for with_page in ((False, True) if number % 2 == 0 else (True, False)):
            found, lost, spent = measure(with_page, arguments.rate, arguments.seconds, cores)
            pair[with_page] = np.array([np.median(found), np.percentile(found, 99)])
            names = ('predictor', 'page')[:len(spent)]
            shares = ', '.join(f'{name} {100.0 * share:.1f} %' for name, share in zip(names, spent, strict=True))
            print(f'{number + 1} {"with   " if with_page else "without"}: {percentiles(found)}  lost {lost}  '
                  f'processor: {shares}', flush=True)
        ratios.append(pair[True] / pair[False])
    median, p99 = np.median(ratios, axis=0)
    print(f'with the page over without, median of {len(ratios)} pairs: median delay {median:.3f}, p99 {p99:.3f}')


if __name__ == '__main__':
    main()
