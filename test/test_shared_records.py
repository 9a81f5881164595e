"""The measured records that come with the package: small, licensed, and what their sources say."""

import numpy as np
import pytest

from swath_sysid.formats.reading import read_trial
from swath_sysid.share import share_folder

RECORDS = share_folder() / 'records'
SOURCES = {'morro_buoy': 'waves/morro_buoy.csv', 'kvlcc2_roll_decay': 'decay/kvlcc2/run2_0kn.csv'}
EVERY = {'morro_buoy': 1, 'kvlcc2_roll_decay': 4}


def test_they_are_small_and_each_is_named_with_its_licence():
    assert sum(path.stat().st_size for path in RECORDS.iterdir()) < 1_000_000
    notice = (RECORDS / 'NOTICE').read_text(encoding='utf-8')
    names = {f'{name}.{ending}' for name in SOURCES for ending in ('csv', 'mcap')}
    assert {path.name for path in RECORDS.iterdir()} == names | {'NOTICE'}
    assert all(name in notice for name in names)
    for licence in ('Copyright © 2021, Battelle', 'Simplified BSD', '(c) 2020, Martin Alexandersson', 'MIT License'):
        assert licence in notice


@pytest.mark.parametrize('name', SOURCES)
def test_the_bag_holds_what_the_table_holds(name):
    table, bag = (read_trial(RECORDS / f'{name}.{ending}') for ending in ('csv', 'mcap'))
    assert list(bag.channels) == list(table.channels)
    np.testing.assert_allclose(bag.time - bag.time[0], table.time - table.time[0], atol=1e-9)
    for channel, values in table.channels.items():
        np.testing.assert_allclose(bag.channels[channel], values, atol=1e-9)


@pytest.mark.parametrize('name', SOURCES)
def test_they_are_the_measured_ones(name, data_folder):
    source = read_trial(data_folder / SOURCES[name], frame='frd' if name == 'morro_buoy' else None)
    ours = read_trial(RECORDS / f'{name}.csv')
    for channel, values in ours.channels.items():
        assert np.array_equal(values, source.channels[channel][:: EVERY[name]][: values.size], equal_nan=True)
