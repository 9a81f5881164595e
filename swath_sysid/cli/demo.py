"""``swath-sysid demo``: a simulated craft, released twice with ``swath-sysid run``, after what the wings show."""

from __future__ import annotations

import math
import os
import random
import shlex
import signal
import subprocess
import threading
import time
from argparse import Namespace
from collections.abc import Callable
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import swath_sysid
from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS, hull_named
from swath_sysid.attitude.hull.craft_simulator import release_angle
from swath_sysid.attitude.identification.refit import verdict_text
from swath_sysid.attitude.motion.intake import NANOSECOND
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.cli.ros import ros_needed
from swath_sysid.cli.run import craft_command, process_beside
from swath_sysid.common.errors import DONE, PARTLY_DONE, InputError
from swath_sysid.common.processes import verb_command
from swath_sysid.common.wings import offered
from swath_sysid.formats.outputs import Output, check_outputs
from swath_sysid.pipeline.demonstration import SCORED_SPAN, Demonstration, LeadForecasts, verdict_of, without_model
from swath_sysid.pipeline.forecast_pipeline import PipelineSettings
from swath_sysid.report.demo_figure import demo_figure
from swath_sysid.report.figures import save_figure

if TYPE_CHECKING:
    from swath_sysid.nodes.demo_monitor import Received

HULLS = {'roll': 'swath-roll', 'pitch': 'swath-pitch'}
SEA, RELEASE = 'sea', 'release'

TIMEOUT_S = 300.0  #: Of every wait: only a failure waits so long.


def run(arguments: Namespace) -> int:
    """Show what wings show, then run the simulated release; 0 if its forecasts are as good as promised."""
    output, only = Path(arguments.output), getattr(arguments, 'only', None)
    check_outputs([Output('--output', output, is_folder=True)])
    of_wings = offered('shown_in_demo')
    if only == SEA:
        _show(of_wings, output)
        return DONE
    with ros_needed(f'the forecast of a measured sea needs none: --only {SEA}' if of_wings else ''):
        import rclpy  # noqa: F401 - only to say what to do where it is missing
    craft = _Craft(arguments.hull, arguments.axis)
    domain = arguments.domain or random.SystemRandom().randint(1, 100)
    if not 0 <= domain <= 101:
        raise InputError(f'the ROS domain must lie between 0 and 101, not {domain}')
    output.mkdir(parents=True, exist_ok=True)
    check_outputs([Output('the log', output / 'demo.log'), Output('the picture', output / 'demo.png')])
    root = str(Path(swath_sysid.__file__).resolve().parents[1])
    os.environ |= {
        'ROS_DOMAIN_ID': str(domain),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'PYTHONPATH': os.pathsep.join(filter(None, [root, os.environ.get('PYTHONPATH')])),
    }
    # while the sea is forecast the nodes start; SIGTERM must end them too
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with _processes(craft, arguments.seed, output / 'demo.log') as processes:
        if only != RELEASE:
            _show(of_wings, output)
        print(f'A simulated craft, {craft.hull}, released twice from {craft.angle_deg:g} deg, with these nodes:')
        print(f'\n    {shlex.join(["swath-sysid", *craft.run_words])}\n')
        print(f'ROS domain {domain}, this machine only; log of the nodes: {output / "demo.log"}', flush=True)
        return _release(craft, processes, output, arguments.keep_running)


def _show(of_wings: list[Callable], output: Path) -> None:
    output.mkdir(parents=True, exist_ok=True)
    for show in of_wings:
        show(output)


def _release(craft: _Craft, processes: Any, output: Path, keeps_running: bool) -> int:
    from swath_sysid.nodes.demo_monitor import Listener
    from swath_sysid.nodes.ros_session import ros_session

    began = time.monotonic()
    with ros_session() as stop:
        listener = Listener(craft.axis, craft.leads)
        try:
            stage = _Stage(listener, processes, stop)
            demonstration = _demonstrate(craft, stage)
            passed = _print_verdict(demonstration, output, began)
            if keeps_running:
                # Ctrl-C is the way to end it, not a failure
                with suppress(KeyboardInterrupt):
                    while True:
                        stage.release('lifting the craft')
                        stage.pause('running until Ctrl-C', SCORED_SPAN)
                        stage.listener.forget()
        finally:
            listener.destroy_node()
    return DONE if passed else PARTLY_DONE


class _Craft:
    """The hull, its release, and the forecast leads: the default ones and one natural period."""

    def __init__(self, hull: str | None, axis: str):
        self.hull = hull or HULLS[axis or 'roll']
        self.model = hull_named(self.hull).model
        self.axis = self.model.axis
        if axis not in (None, self.axis):
            fitting = ', '.join(name for name, held in PUBLISHED_HULLS.items() if held.axis == axis)
            raise InputError(f'{self.hull} is a hull in {self.axis}: leave --axis out, or choose from {fitting}')
        self.period = self.model.natural_period
        self.angle_deg = math.degrees(release_angle(self.model))
        self.lead = round(self.period, 2)
        self.leads = tuple(sorted({*ForecasterSettings().leads, self.lead}))

    @property
    def run_words(self) -> list[str]:
        """The user's command that starts the nodes."""
        return ['run', '--ros-args', '-p', f'leads_s:={list(self.leads)}']

    @property
    def pipeline_settings(self) -> PipelineSettings:
        """The predictor's settings."""
        return PipelineSettings(forecaster=ForecasterSettings(leads=self.leads))


@contextmanager
def _processes(craft: _Craft, seed: int, log_path: Path):
    """The craft and the nodes as users start them, ended with the demonstration."""
    simulated = craft_command(hull=craft.hull, noise_seed=seed)
    with open(log_path, 'w', encoding='utf-8') as log:
        how = {'stdout': log, 'stderr': log, 'stdin': subprocess.DEVNULL}
        with process_beside(simulated, **how) as first, process_beside(verb_command(*craft.run_words), **how) as second:
            yield {'simulated_craft': first, 'run': second}


class _Stage:
    """The running demonstration: spins the monitor, prints changes, waits for conditions."""

    def __init__(self, listener: Any, processes: Any, stop: threading.Event):
        self.listener = listener
        self._processes = processes
        self._stop = stop
        self._printed = ''
        self._versions = 0

    def wait(self, stage: str, done: Callable[[], bool], timeout: float) -> bool:
        """Wait for ``done()``; False after the time-out, s. Raises KeyboardInterrupt after Ctrl-C or SIGTERM."""
        import rclpy

        deadline = time.monotonic() + timeout
        if stage != self._printed:
            self._printed = stage
            print(stage, flush=True)
        while not done():
            if time.monotonic() >= deadline:
                return False
            for name, process in self._processes.items():
                if process.poll() is not None:
                    raise InputError(f'the process {name} ended with code {process.returncode}: see demo.log')
            rclpy.spin_once(self.listener, timeout_sec=0.05)
            if self._stop.is_set():
                raise KeyboardInterrupt
            self._print_models()
        return True

    def _print_models(self) -> None:
        received = self.listener.received
        if received.versions == self._versions:
            return
        self._versions = received.versions
        for axis, held in received.models.items():
            terms = ', '.join(f'{name} {value:.3g} ± {held.std[name]:.2g}' for name, value in held.model.terms.items())
            print(f'    {axis}: natural period {held.model.natural_period:.2f} s; over the inertia, damping b and')
            print(f'    restoring r: {terms}')
            print(f'    {verdict_text(held)}', flush=True)

    def pause(self, stage: str, duration: float) -> None:
        """Wait for s of the sensor's stamps."""
        end = self.listener.received.angles[-1][0] + round(duration / NANOSECOND)
        self.wait(stage, lambda: self.listener.received.angles[-1][0] >= end, 10.0 * duration + TIMEOUT_S)

    def release(self, stage: str) -> int:
        """Have the craft released; the stamp of the release, ns."""
        answer = self.listener.release()
        if not self.wait(stage, answer.done, TIMEOUT_S) or not answer.result().success:
            raise InputError('the simulated craft does not answer: see demo.log')
        return int(answer.result().message)


def _demonstrate(craft: _Craft, stage: _Stage):
    """Release the craft, wait for its model, release it again."""
    received = stage.listener.received
    starting = 'waiting until the nodes are ready'
    if not stage.wait(starting, stage.listener.is_ready, TIMEOUT_S):
        raise InputError(f'the nodes sent nothing within {TIMEOUT_S:g} s: see demo.log')
    stage.pause('still water, no model', craft.period)
    waiting = 'released; waiting until the decay is detected and the model identified'
    for lifting in ('lifting the craft', 'lifting the craft again, as no model came'):
        first = stage.release(lifting)
        if stage.wait(waiting, lambda: received.model_ns is not None, TIMEOUT_S):
            break
    else:
        raise InputError(f'no model was published within {TIMEOUT_S:g} s of either release: see demo.log')
    stage.pause('identified', craft.period)
    second = stage.release('lifting the craft again')
    stage.pause('forecasting with the identified model', (second - received.angles[-1][0]) * NANOSECOND + SCORED_SPAN)
    return _demonstration(craft, received, first, second)


def _demonstration(craft: _Craft, received: Received, first: Any, second: int):
    start = received.angles[0][0]
    unaided = without_model(received.readings, craft.axis, craft.pipeline_settings)

    def relative(found: Any):
        return tuple(LeadForecasts(lead, *_table(rows, 3, start).T) for lead, rows in sorted(found.items()))

    time_, angle = _table(received.angles, 2, start).T
    return Demonstration(
        craft.axis,
        craft.hull,
        math.radians(craft.angle_deg),
        craft.period,
        time_,
        angle,
        tuple((stamp - start) * NANOSECOND for stamp in (first, second)),
        (received.model_ns - start) * NANOSECOND,
        relative(received.forecasts),
        relative(unaided),
    )


def _print_verdict(demonstration: Demonstration, output: Path, began: float):
    """Write the figure, print the verdict."""
    verdict = verdict_of(demonstration)
    if math.isfinite(verdict.after):
        picture = output / 'demo.png'
        save_figure(demo_figure(demonstration, verdict), picture)
        print(f'{picture}, after {time.monotonic() - began:.0f} s')
    print(verdict.text, flush=True)
    return verdict.is_good


def _table(rows: Any, columns: int, start: int = 0):
    """Rows whose first column is a stamp, ns, as an array with seconds since the start."""
    if not rows:
        return np.empty((0, columns))
    return np.array([((row[0] - start) * NANOSECOND, *row[1:]) for row in rows])
