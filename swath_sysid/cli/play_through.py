"""``swath-sysid play-through``: what the nodes would have published on a record, as fast as the machine can."""

import gc
import os
import sys
from argparse import Namespace
from dataclasses import replace
from typing import Any

from swath_sysid.attitude.hull.identified_model import check_mounting
from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.cli.progress import print_result, progress_of, show_advice
from swath_sysid.cli.sources import columns_of, installation_of
from swath_sysid.common.advice import Advice, counted
from swath_sysid.common.conditions import CONDITIONS
from swath_sysid.common.wings import offered
from swath_sysid.formats.bags import is_bag
from swath_sysid.formats.model_file import read_model
from swath_sysid.formats.output_bag import writing_output_bag
from swath_sysid.formats.outputs import Output, check_outputs
from swath_sysid.formats.reading import read_readings
from swath_sysid.formats.topics import IMU_TOPIC, WINDOW_TOPIC
from swath_sysid.formats.upstream_channels import read_upstream
from swath_sysid.nodes.parameters.parameter_files import values_from_file
from swath_sysid.nodes.parameters.settings import (
    frames_at,
    pipeline_settings,
    refit_settings,
    window_settings,
)
from swath_sysid.nodes.parameters.table import ATTITUDE_NODES, Values
from swath_sysid.pipeline.play_through import PlayedHealth, PlayThrough, PlayThroughSettings
from swath_sysid.pipeline.record_run import ArrivingSamples


def run(arguments: Namespace) -> int:
    """Play the record through and write the output."""
    check_outputs(
        [Output('--output', arguments.output, is_recording=True, endings=('mcap',))],
        [arguments.record, arguments.params_file, arguments.model],
    )
    beside: list[Advice] = []
    for play in offered('plays_bag') if is_bag(arguments.record) else ():
        code, advice = play(arguments)
        if code is not None:
            return code
        beside += advice
    nodes = {name: values_from_file(arguments.params_file, name) for name in ATTITUDE_NODES}
    predictor = nodes['predictor']
    stated = installation_of(arguments)
    readings = read_readings(arguments.record, arguments.topic, **stated, columns=columns_of(arguments))
    mount = readings.turned or readings.installation(**stated)
    channels = [*filter(None, predictor['upstream']), *arguments.upstream]
    upstream = read_upstream(arguments.record, channels, topic=arguments.topic, columns=columns_of(arguments))
    # readings in the axes of the craft are turned no more
    pipeline = _pipeline_of(nodes, arguments, Installation() if readings.turned else mount, tuple(upstream))
    check_mounting(pipeline.refitter.models, mount)
    arriving = ArrivingSamples(upstream, pipeline.add_upstream, int(readings.stamps[0]) - round(1e9 * readings.start))
    health = PlayedHealth(pipeline, IMU_TOPIC, [values['diagnostics_period_s'] for values in nodes.values()])
    verdicts = []
    frames = frames_at(predictor['frames_at_s'])
    # else the collector goes through all that is loaded again and again: 5 % of the time
    gc.freeze()
    with (
        progress_of('play-through') as progress,
        writing_output_bag(arguments.output, frame_id=predictor['frame_id'], frames_at=frames) as bag,
    ):
        for index, reading in enumerate(readings):
            if arguments.with_imu:
                bag.add_imu(reading.stamp_ns, readings.values[index])
            arriving.until(reading.stamp_ns)
            played = pipeline.add(reading)
            bag.add_played(played)
            for statuses in health.follow(played):
                bag.add_diagnostics(played.stamp_ns, statuses)
            if played.verdict is not None:
                verdicts.append((reading.stamp_ns, played.verdict))
            progress((index + 1) / len(readings))
    show_advice((*readings.advice, *beside))
    stability = pipeline.refitter.stability.newest
    show_advice((*pipeline.forecasts.installation.contradictions, *(() if stability is None else stability.advice)))
    counted_reasons = _report_counts(pipeline, len(readings))
    refits = [((stamp_ns - int(readings.stamps[0])) / 1e9, str(verdict)) for stamp_ns, verdict in verdicts]
    published = ', '.join(f'{topic} {count}' for topic, count in bag.counts.items()) or 'nothing'
    data = {
        'file': arguments.output,
        'messages': len(readings),
        'published': dict(bag.counts),
        'refits': [{'t_s': t, 'verdict': verdict} for t, verdict in refits],
        'counted': counted_reasons,
    }
    lines = [f'{t:.2f} s: {verdict}' for t, verdict in refits]
    lines.append(f'{arguments.output}: from {len(readings)} messages {published}')
    print_result(arguments.json, data, lines)
    return 0


def _pipeline_of(
    nodes: dict[str, Values], arguments: Namespace, mount: Installation, upstream: tuple[str, ...]
) -> PlayThrough:
    """The nodes as their parameters set them, with a mounting of the sensor."""
    buffer, identifier, predictor = (nodes[name] for name in ATTITUDE_NODES)
    forecasts = pipeline_settings(predictor)
    settings = PlayThroughSettings(
        replace(window_settings(buffer), installation=mount),
        refit_settings(identifier),
        replace(forecasts, installation=mount, forecaster=replace(forecasts.forecaster, upstream=upstream)),
        identifier['auto_identify'],
        arguments.refit_delay,
        {'topic': WINDOW_TOPIC},
        identifier['identify_interval_s'],
    )
    own = os.path.expanduser(identifier['model_path'])
    known = arguments.model or (own if os.path.exists(own) else '')
    pipeline = PlayThrough(settings, read_model(known) if known else {})
    pipeline.window.record(buffer['record_at_start'])
    return pipeline


def _report_counts(pipeline: Any, messages: int) -> dict[str, int]:
    """What was counted, by reason; with its meaning on standard error, where a reason of all messages has no count."""
    counts = {**pipeline.forecasts.counts, **pipeline.window.counts}
    found = {reason: count for reason, count in counts.items() if count}
    for reason, count in found.items():
        times = '' if count >= messages else f' ({counted(count, "time")})'
        print(f'{reason}{times}: {CONDITIONS[reason].cure}', file=sys.stderr)
    return found
