"""``swath-sysid paper``: a published study carried out again, printed and obtained values side by side."""

import time
from argparse import Namespace
from pathlib import Path
from typing import Any

from swath_sysid.cli.progress import print_result, progress_of
from swath_sysid.common.wings import handed_in, named
from swath_sysid.formats.files import write_text
from swath_sysid.formats.outputs import Output, check_outputs
from swath_sysid.tank.campaign.work import executor_of
from swath_sysid.tank.papers.decay_study import run_decay_study
from swath_sysid.tank.report.paper_decay import decay_page


def run(arguments: Namespace) -> int:
    """Simulate, identify, and write one page."""
    path = Path(arguments.output or f'{arguments.study}.html')
    check_outputs([Output('--output', path, endings=('html',))])
    page, data = named(handed_in('papers')[arguments.study])(arguments)
    write_text(path, page)
    print_result(arguments.json, {'report': str(path), **data}, [str(path)])
    return 0


def repeat_decay_study(arguments: Namespace) -> tuple[str, dict[str, Any]]:
    """The page of a study of free decays, and its data."""
    began = time.perf_counter()
    with executor_of(arguments.jobs) as executor, progress_of('paper') as progress:
        study = run_decay_study(arguments.study, executor, lambda done, total: progress(done / total))
    records = [
        {
            'draft_factor': record.draft_factor,
            'angle_deg': record.angle_deg,
            'true_ratios': record.hull.terms,
            'ratios': record.ours.model.terms,
            'r2': record.ours.r2,
        }
        for record in study.records
    ]
    return decay_page(study, time.perf_counter() - began), {'records': records}
