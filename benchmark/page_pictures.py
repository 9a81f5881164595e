"""The pictures of the page in docs/: a simulated craft, released twice and accepted, in headless Chromium.

    python benchmark/page_pictures.py --write docs
    python benchmark/page_pictures.py --hull swath-pitch --views out

The first writes the pictures of the site, the second the accepted page at 1280 and 400 px, light and dark. Needs the
extras `ros` and `page`, selenium, and Chromium with its driver.
"""

import argparse
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from selenium import webdriver

from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS, hull_named
from swath_sysid.cli.run import process_beside
from swath_sysid.common.processes import verb_command

PATIENCE = 180.0
PICTURES = {
    'at rest': 'tutorials/first_live_model_push.png',
    'first': 'tutorials/first_live_model_first.png',
    'accepted': 'howto/page.png',
}


class Page:
    """The page of a craft, in a browser."""

    def __init__(self, driver):
        self.driver = driver

    def text(self, name):
        return self.driver.execute_script(f"return document.querySelector('[data-name={name}]')?.innerText ?? ''")

    def wait_for(self, done, what):
        end = time.monotonic() + PATIENCE
        while not done():
            if time.monotonic() > end:
                raise SystemExit(f'no {what}: the page shows {self.text("sentence")!r} {self.text("cure")!r}')
            time.sleep(0.2)

    def press(self, name):
        script = f"const b = document.querySelector('[data-name={name}]:enabled'); b?.click(); return b !== null"
        self.wait_for(lambda: self.driver.execute_script(script), f'button {name} that can be pressed')

    def release(self, count):
        """Push and let go until so many releases have led to models."""
        self.press('push')
        self.wait_for(lambda: self.text('releases').count('From ') >= count, 'decay')
        self.wait_for(lambda: 'next release' in self.text('releases').partition('\n')[0], 'model')

    def view(self, width, height, dark, path):
        run = self.driver.execute_cdp_cmd
        size = {'width': width, 'height': height, 'deviceScaleFactor': 1, 'mobile': False}
        run('Emulation.setDeviceMetricsOverride', size)
        scheme = {'name': 'prefers-color-scheme', 'value': 'dark' if dark else 'light'}
        run('Emulation.setEmulatedMedia', {'features': [scheme]})
        time.sleep(2.0)
        path.parent.mkdir(parents=True, exist_ok=True)
        self.driver.save_screenshot(str(path))
        print(path, flush=True)


def browser():
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which('chromium')
    for argument in ('--headless=new', '--no-sandbox', '--disable-dev-shm-usage', '--disable-gpu'):
        options.add_argument(argument)
    return webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which('chromedriver')))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--hull', choices=PUBLISHED_HULLS, default='swath-roll')
    parser.add_argument('--write', type=Path, metavar='DOCS')
    parser.add_argument('--views', type=Path, metavar='DIR')
    arguments = parser.parse_args()
    domain = os.environ.get('ROS_DOMAIN_ID') or str(random.SystemRandom().randint(1, 100))
    os.environ |= {'ROS_DOMAIN_ID': domain, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    os.environ.setdefault('AMENT_PREFIX_PATH', sys.prefix)
    page = verb_command('page', '--port', '0', '--axis', hull_named(arguments.hull).axis)
    with ExitStack() as stack, tempfile.TemporaryFile() as log:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        stack.enter_context(process_beside(verb_command('run', '--simulate', arguments.hull), stdout=log, stderr=log))
        output = {'stderr': subprocess.PIPE, 'text': True, 'cwd': folder}
        served = stack.enter_context(process_beside(page, **output))
        address = next(line.split()[-1] for line in served.stderr if 'the page is at' in line)
        driver = browser()
        stack.callback(driver.quit)
        shown = Page(driver)
        driver.get(address)

        def picture(name, height):
            if arguments.write:
                shown.view(1280, height, False, arguments.write / PICTURES[name])

        shown.wait_for(lambda: 'Now press Push' in shown.text('sentence'), 'rest')
        picture('at rest', 620)
        shown.release(1)
        picture('first', 620)
        shown.release(2)
        shown.press('accept')
        shown.wait_for(lambda: 'Kept' in shown.text('sentence'), 'acceptance')
        # forecasts of the next release
        shown.press('push')
        time.sleep(6.0)
        picture('accepted', 1500)
        for width, height in ((1280, 1500), (400, 3400)) if arguments.views else ():
            for dark in (False, True):
                name = f'{arguments.hull}_{width}_{"dark" if dark else "light"}.png'
                shown.view(width, height, dark, arguments.views / name)


if __name__ == '__main__':
    main()
