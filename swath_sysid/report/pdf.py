"""A page as PDF, printed by the browser or the library that is there."""

import importlib.util
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import replacing

BROWSERS = 'chromium', 'chromium-browser', 'google-chrome', 'google-chrome-stable', 'microsoft-edge', 'brave-browser'
PATIENCE = 300.0  #: s; only a browser that hangs is waited for so long.


def printer() -> str:
    """Path of the browser that prints, or ``weasyprint``; raises `InputError` where neither is there."""
    found = next(filter(None, map(shutil.which, BROWSERS)), '')
    if not found and importlib.util.find_spec('weasyprint') is None:
        raise InputError(
            'a PDF is printed by Chromium, Chrome or Edge, or by the Python package weasyprint, and none is installed: '
            'install one, or open the page in a browser and print it'
        )
    return found or 'weasyprint'


def write_pdf(page: Path, path: Path) -> None:
    """Print a page of this package, its folded parts too."""
    by = printer()
    with replacing(path) as temporary:
        if by == 'weasyprint':
            import weasyprint

            weasyprint.HTML(filename=str(page)).write_pdf(str(temporary), presentational_hints=True)
            return
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
