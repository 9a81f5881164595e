"""``swath-sysid campaign``: a whole trial matrix to tables, figures and a model that depends on the draft."""

import math
import sys
import time
from argparse import Namespace
from dataclasses import replace
from pathlib import Path

from swath_sysid.attitude.motion.sensor_checks import TILT_CODES
from swath_sysid.cli.progress import print_result, show_advice
from swath_sysid.common.errors import DONE, PARTLY_DONE, InputError
from swath_sysid.formats.outputs import Output, check_outputs, refuse_inputs_among
from swath_sysid.tank.campaign.manifest import read_manifest
from swath_sysid.tank.campaign.proposal import write_new_manifest
from swath_sysid.tank.campaign.run import CampaignOutcome, run_campaign
from swath_sysid.tank.cli.kept_work import RESULTS, kept_work, said_to_continue
from swath_sysid.tank.report.campaign_report import REPORTED, write_report
from swath_sysid.tank.report.campaign_results import conclusion_of, left_out_of, used_of
from swath_sysid.tank.report.pdf import browser, write_pdf

MANIFEST = 'campaign.yaml'


def run(arguments: Namespace) -> int:
    """Write a manifest, or work one off."""
    if (arguments.new is None) == (arguments.manifest is None):
        raise InputError('give either a manifest, or --new with the folder of the trials')
    if arguments.new is not None:
        path = Path(Path(arguments.new) / MANIFEST if arguments.output is None else arguments.output)
        check_outputs([Output('--output', path)])
        for line in write_new_manifest(arguments.new, path, arguments.mounting):
            print(f'warning: {line}', file=sys.stderr)
        print(f'{path}: check it, then run: swath-sysid campaign {path} --output FOLDER')
        return DONE
    if arguments.output is None:
        raise InputError('give --output with the folder of the report')
    with said_to_continue():
        return _work_off(arguments)


def _work_off(arguments: Namespace) -> int:
    began = time.perf_counter()
    if arguments.pdf:
        browser()
    check_outputs([Output('--output', arguments.output, is_folder=True)], [arguments.manifest])
    manifest = read_manifest(arguments.manifest)
    if arguments.mounting:
        roll, pitch, yaw = map(math.degrees, arguments.mounting)
        manifest = replace(
            manifest, trials=tuple(replace(each, mounting_deg=(roll, pitch, yaw)) for each in manifest.trials)
        )
    folder = Path(arguments.output)
    read = [arguments.manifest, *(trial.path for trial in manifest.trials)]
    refuse_inputs_among([folder / name for name in (*REPORTED, RESULTS)], read)
    for fault in manifest.faults:
        print(f'warning: {arguments.manifest}, {fault}', file=sys.stderr)
    with kept_work('campaign', folder, arguments) as (store, executor, progress):
        outcome = run_campaign(
            manifest, store, executor, lambda at: progress(at.done / max(at.total, 1), '; '.join(at.running[:2]))
        )
    report = write_report(outcome, arguments.output, arguments.annex)
    if arguments.pdf:
        write_pdf(report, report.with_suffix('.pdf'))
        report = report.with_suffix('.pdf')
    _print_outcome(outcome, report, time.perf_counter() - began, arguments.json)
    is_whole = all(t.record is not None for t in outcome.trials) and not (manifest.faults or outcome.failures)
    return DONE if is_whole else PARTLY_DONE


def _print_outcome(outcome: CampaignOutcome, report: Path, wall_s: float, as_json: bool):
    left_out = left_out_of(outcome)
    shown = {'several-drafts', *TILT_CODES}
    show_advice(dict.fromkeys(a for t in outcome.trials for a in t.advice if a.code in shown))
    for line in (*left_out, *outcome.failures):
        print(f'left out: {line}', file=sys.stderr)
    data = {
        'report': str(report.with_suffix('.html')),
        'trials': len(outcome.trials),
        'left_out': [*outcome.manifest.faults, *left_out, *outcome.failures],
        'axes': {
            axis.axis: {
                'choice': axis.ranking.choice.name,
                'reason': axis.ranking.reason,
                'findings': [finding.message for finding in axis.ranking.findings],
            }
            for axis in outcome.axes
        },
        'computed': outcome.computed,
        'kept': outcome.kept,
        'wall_s': wall_s,
    }
    lines = []
    for axis in outcome.axes:
        lines += [f'{axis.axis}: {axis.ranking.reason}', *(f'  {a.message}' for a in axis.ranking.findings)]
    lines += [
        f'{outcome.computed} tasks computed, {outcome.kept} reused, {wall_s:.1f} s',
    ]
    print_result(as_json, data, lines, [f'{used_of(outcome)}; report: {report}', *conclusion_of(outcome)])
