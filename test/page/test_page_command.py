"""The page beside the nodes, and what it needs and shows of others."""

import argparse
import re

import pytest
from test_cli_run import parsed
from test_light import loaded_by

from swath_sysid.cli.main import main
from swath_sysid.common.errors import InputError
from swath_sysid.page.cli import beside, page


def test_the_page_beside_the_nodes_hears_the_same_names(monkeypatch):
    monkeypatch.setattr('swath_sysid.page.server.check_installed', lambda: None)
    command = beside.page_command(parsed('--page', '--namespace', '/craft/', '--imu-topic', '/sensor/imu'))
    assert command[4:] == ['page', '--namespace', '/craft/', '--imu-topic', '/sensor/imu']
    assert beside.page_command(parsed('--page', '--simulate', 'swath-pitch'))[-2:] == ['--axis', 'pitch']
    assert beside.page_command(parsed('--page', '--port', '0'))[4:] == ['page', '--port', '0']


def test_a_port_without_a_page_is_refused_before_anything_starts(capsys):
    pytest.importorskip('rclpy')
    assert main(['run', '--port', '8090']) == 2
    assert 'add --page' in capsys.readouterr().err


def test_without_its_extra_it_says_what_to_install(monkeypatch):
    monkeypatch.setattr('swath_sysid.page.server.ui', None)
    with pytest.raises(InputError, match=re.escape('pip install "swath_sysid[page]"')):
        page.run(argparse.Namespace())


def test_whoever_comes_from_elsewhere_is_asked_for_a_token():
    for host, given, length in (('localhost', '', 0), ('localhost', 'mine', 4), ('0.0.0.0', '', 16)):
        assert len(page.token_for(host, given)) == length


@pytest.mark.long
def test_it_loads_no_filter():
    assert 'filterpy' not in loaded_by('swath_sysid.page.cli.page, swath_sysid.page.live_view')
