"""``swath-sysid paper``: a published study carried out again, printed and obtained values side by side."""

import time
from argparse import Namespace
from pathlib import Path
from typing import Any

from swath_sysid.campaign.papers.decay_study import run_decay_study
from swath_sysid.campaign.papers.manoeuvring_study import run_manoeuvring_study
from swath_sysid.campaign.papers.publication import MANOEUVRING_STUDY
from swath_sysid.campaign.work import executor_of
from swath_sysid.cli.progress import print_result, progress_of
from swath_sysid.formats.files import write_text
from swath_sysid.formats.outputs import Output, check_outputs
from swath_sysid.report.paper_decay import decay_page
from swath_sysid.report.paper_manoeuvring import manoeuvring_page


def run(arguments: Namespace) -> int:
    """Simulate, identify, and write one page."""
    began = time.perf_counter()
    path = Path(arguments.output or f'{arguments.study}.html')
    check_outputs([Output('--output', path, endings=('html',))])
    if arguments.study == MANOEUVRING_STUDY:
        manoeuvring = run_manoeuvring_study()
        page = manoeuvring_page(manoeuvring, time.perf_counter() - began)
        data: dict[str, Any] = {'derivatives': [vars(derivative) for derivative in manoeuvring.derivatives]}
    else:
        with executor_of(arguments.jobs) as executor, progress_of('paper') as progress:
            study = run_decay_study(arguments.study, executor, lambda done, total: progress(done / total))
        page = decay_page(study, time.perf_counter() - began)
        data = {
            'records': [
                {
                    'draft_factor': record.draft_factor,
                    'angle_deg': record.angle_deg,
                    'true_ratios': record.hull.terms,
                    'ratios': record.ours.model.terms,
                    'r2': record.ours.r2,
                }
                for record in study.records
            ]
        }
    write_text(path, page)
    print_result(arguments.json, {'report': str(path), **data}, [str(path)])
    return 0
