"""Trials and models of simulated manoeuvring craft, for the tests of that wing."""

from dataclasses import replace

import numpy as np
from bag_messages import STORE
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer

from swath_sysid.manoeuvring.hull.identified_model import IdentifiedManoeuvringModel, Region
from swath_sysid.manoeuvring.hull.model import preset
from swath_sysid.manoeuvring.hull.standard_tests import RunNoise, trial_programme, with_noise
from swath_sysid.manoeuvring.motion.intake import prepare_runs
from swath_sysid.manoeuvring.motion.trial import ManoeuvringTrial

OLD = preset('wamv-vrx-old')
NOISE = np.array([0.05, 0.05, 0.005])
REGION = Region(-0.5, 1.7, 0.8, 0.3, -60.0, 150.0, 120.0)
MODEL = IdentifiedManoeuvringModel(OLD, (), np.zeros((0, 0)), NOISE, REGION)


def identified(model=OLD):
    """A model of which two derivatives are uncertain."""
    spread = np.array([[1.0, 0.1], [0.1, 4.0]])
    return IdentifiedManoeuvringModel(model, ('Xu', 'Nr'), spread, NOISE, REGION, {'r2': 0.99}, {'software': 'test'})


def trial_of(m, name, thrust_input='force'):
    """A simulated manoeuvre as it would have been recorded."""
    motion = m.surge, m.sway, m.yaw_rate, m.heading, m.x, m.y
    return ManoeuvringTrial(m.time, m.port, m.starboard, thrust_input, *motion, 'enu', source=name)


def runs_of(model=OLD, seed=1, names=None, currents=None):
    """Runs of the programme as noisy sensors record them, each in a current where given."""
    programme = trial_programme(model)
    trials = []
    for k, name in enumerate(names or programme):
        m = programme[name] if currents is None else drifting(programme[name], currents[k])
        trials.append(trial_of(with_noise(m, RunNoise(), 100 * seed + k), name, model.thrust_input))
    return prepare_runs(trials)


def drifting(m, current):
    """The manoeuvre in a current, east and north, m/s."""
    east, north = current
    cosine, sine = np.cos(m.heading), np.sin(m.heading)
    return replace(
        m,
        surge=m.surge + east * cosine + north * sine,
        sway=m.sway - east * sine + north * cosine,
        x=m.x + east * m.time,
        y=m.y + north * m.time,
    )


def codes(*of):
    """The codes of all advice of runs, trials or models."""
    return {advice.code for each in of for advice in each.advice}


def copy_bag(source, target, changed):
    """Copy the messages of a bag: ``changed`` gives from one message those written, as topic, kind and message."""
    connections = {}
    with (
        AnyReader([source], default_typestore=STORE) as reader,
        Writer(target, version=9, storage_plugin=StoragePlugin.MCAP) as writer,
    ):
        for connection, stamp, raw in reader.messages():
            message = STORE.deserialize_cdr(raw, connection.msgtype)
            for topic, kind, written in changed(connection.topic, connection.msgtype, message):
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
                writer.write(connections[topic], stamp, STORE.serialize_cdr(written, kind))
