"""The times of a replay, without ROS and without waiting."""

import pytest

from swath_sysid.common.errors import InputError
from swath_sysid.formats.bag_replay import ReplaySettings, Timeline


@pytest.mark.parametrize('rate', [0.5, 1.0, 20.0])
def test_bag_time_is_the_inverse_of_wall_time(rate):
    timeline = Timeline(begun=100.0, first_ns=1_700_000_000_000_000_000, rate=rate)
    later = timeline.first_ns + 3_000_000_000
    assert timeline.wall_time(timeline.first_ns) == 100.0
    assert timeline.wall_time(later) == pytest.approx(100.0 + 3.0 / rate)
    assert timeline.bag_time(timeline.wall_time(later)) == pytest.approx(later, abs=2000)


@pytest.mark.parametrize('settings', [{'rate': 0.0}, {'rate': float('nan')}, {'wait': -1.0}, {'listeners': -1}])
def test_settings_that_cannot_be_are_refused(settings):
    with pytest.raises(InputError, match='must'):
        ReplaySettings(**settings)
