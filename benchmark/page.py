"""What the page costs the predictor: 200 Hz, five browsers, one of them stalled.

    python benchmark/page.py --seconds 20 --rounds 2

With and without the page in turns, each with the nodes in processes of their own: delay from the sensor's message to
forecast/next, messages lost, and the predictor's processor time, which other processes on the machine change least.
Needs the extra `page`, selenium, and chromium with its driver; without them it says so and ends.
"""
import argparse
import os
import shutil
import signal
import tempfile
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
from latency import background, delays, environment, node, percentiles, process, processor_seconds, role

BROWSERS = 5
PORT = 8585
ADDRESS = f'http://localhost:{PORT}/'


def measure(with_page, rate, seconds):
    """Delays, ms, messages lost, and the predictor's processor time a message, ms."""
    env = environment()
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        sent_path, arrived_path = Path(folder, 'sent.npy'), Path(folder, 'arrived.npz')
        stack.enter_context(process(*role('sink', topics=['forecast/next'], output=str(arrived_path)), environment=env))
        for name in ('imu_buffer', 'identifier'):
            stack.enter_context(process(*node(name), environment=env))
        predictor = stack.enter_context(process(*node('predictor'), environment=env))
        if with_page:
            words = ['-m', 'swath_sysid.cli.main', 'page', '--port', str(PORT), '--output', folder]
            stack.enter_context(process(*words, environment=env))
            stack.enter_context(looked_at())
        words = role('source', rate=rate, seconds=seconds, subscribers=2 + with_page, output=str(sent_path))
        source = background(words, env)
        begun = processor_seconds(predictor.pid)
        source.wait()
        spent = processor_seconds(predictor.pid) - begun
        stack.close()
        sent, arrived = np.load(sent_path), np.load(arrived_path)['forecast_next']
        found = delays(sent, arrived, round(1e9 / rate))
    return found[round(2 * rate):], len(sent) - len(found), 1e3 * spent / len(sent)


@contextmanager
def looked_at():
    """So many browsers look at the page, and one of them stops in the midst of it."""
    with ExitStack() as stack:
        for _ in range(BROWSERS):
            driver = browser()
            stack.callback(driver.quit)
            wait_for_page(driver)
        stalled = [pid for pid in descendants(driver.service.process.pid) if pid != driver.service.process.pid]
        for pid in stalled:
            os.kill(pid, signal.SIGSTOP)
        try:
            yield
        finally:
            for pid in stalled:
                os.kill(pid, signal.SIGCONT)


def browser():
    """A headless Chromium."""
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which('chromium')
    for argument in ('--headless=new', '--no-sandbox', '--disable-dev-shm-usage', '--disable-gpu'):
        options.add_argument(argument)
    # they stand for browsers on other machines: here they would take the nodes' processor
    service = webdriver.ChromeService(shutil.which('chromedriver'), popen_kw={'preexec_fn': lambda: os.nice(19)})
    return webdriver.Chrome(options=options, service=service)


def wait_for_page(driver):
    """Until the page is shown."""
    from selenium.common.exceptions import WebDriverException

    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        try:
            driver.get(ADDRESS)
            if driver.execute_script("return document.querySelectorAll('canvas').length"):
                return
        except WebDriverException:
            # it does not listen yet
            pass
        time.sleep(0.5)
    raise SystemExit(f'{ADDRESS} shows nothing')


def descendants(pid):
    """A process and all that it started."""
    children = Path(f'/proc/{pid}/task/{pid}/children').read_text().split()
    return [pid, *(each for child in children for each in descendants(int(child)))]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--rate', type=float, default=200.0)
    parser.add_argument('--seconds', type=float, default=30.0)
    parser.add_argument('--rounds', type=int, default=2)
    arguments = parser.parse_args()
    try:
        import nicegui  # noqa: F401
        import selenium  # noqa: F401
    except ImportError as error:
        print(f'left out: {error}; pip install "swath_sysid[page]" selenium')
        return
    if not (shutil.which('chromium') and shutil.which('chromedriver')):
        print('left out: no chromium with its driver; apt install chromium chromium-driver')
        return
    for round_number in range(arguments.rounds):
        for with_page in (False, True):
            found, lost, spent = measure(with_page, arguments.rate, arguments.seconds)
            name = f'page and {BROWSERS} browsers, one stalled' if with_page else 'without the page'
            print(f'round {round_number + 1}, {name:36}: {percentiles(found)}, lost {lost}, '
                  f'predictor {spent:.3f} ms of processor time a message', flush=True)


if __name__ == '__main__':
    main()
