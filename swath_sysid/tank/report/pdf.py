"""A page as PDF, printed by the browser that is there."""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import replacing

BROWSERS = 'chromium', 'chromium-browser', 'google-chrome', 'google-chrome-stable', 'microsoft-edge', 'brave-browser'
PATIENCE = 300.0  #: s; only a browser that hangs is waited for so long.


def browser() -> str:
    """Path of a browser that prints; raises `InputError` where there is none."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        raise InputError(
            'a PDF is printed by Chromium, Chrome or Edge, and none is installed: install one, or leave --pdf out and '
            'print the page from any browser'
        )
    return found


def write_pdf(page: Path, path: Path) -> None:
    """Print a page of this package, its folded parts too."""
    by = browser()
    with replacing(path) as temporary:
        with tempfile.TemporaryDirectory() as profile:
            command = [by, '--headless', '--disable-gpu', '--no-first-run', f'--user-data-dir={profile}']
            # the sandbox of Chromium does not start for root, as in a container
            command += ['--no-sandbox'] if os.geteuid() == 0 else []
            command += ['--no-pdf-header-footer', f'--print-to-pdf={temporary}', page.resolve().as_uri()]
            try:
                subprocess.run(command, capture_output=True, timeout=PATIENCE, check=True)
            except (OSError, subprocess.SubprocessError) as error:
                raise InputError(f'{by} did not print {page}: open the page in a browser and print it') from error
        if not Path(temporary).is_file():
            raise InputError(f'{by} did not print {page}: open the page in a browser and print it')
