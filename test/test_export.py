"""Exports, each held against the target's own equations, written here again from its sources."""
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml

from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.cli.main import main
from swath_sysid.formats.export.expressible import expressed
from swath_sysid.formats.export.gazebo import ELEMENTS as GAZEBO
from swath_sysid.formats.export.gazebo import gazebo, gazebo_attitude
from swath_sysid.formats.export.nav2 import nav2
from swath_sysid.formats.export.vrx import vrx
from swath_sysid.formats.manoeuvring_model_file import write_manoeuvring_model
from swath_sysid.formats.model_file import write_model
from swath_sysid.manoeuvring.hull.identified_model import IdentifiedManoeuvringModel
from swath_sysid.manoeuvring.hull.presets import preset
from swath_sysid.manoeuvring.hull.simulation import simulate
from swath_sysid.manoeuvring.hull.stability import Region
from swath_sysid.manoeuvring.hull.standard_tests import run_test

NEW = preset('wamv-vrx-new')
DIAGONAL = NEW.with_values(Xu_dot=-20.0, Yv_dot=-60.0, Nr_dot=-150.0)
CROSSED = DIAGONAL.with_values(
    Yr_dot=-20.0, Nv_dot=-60.0, Xvr=150.0, Xvv=-120.0, Xrr=-200.0, Yr=-20.0, Yur=-30.0, Yuv=-50.0, Nur=-90.0, Nv=-25.0,
    Nuv=-35.0, deduction=0.1, moment_factor=0.2, balance=0.03)  # fmt: skip
CUBIC = CROSSED.with_values(Nrrr=-900.0, Nuur=-60.0, Xuuu=-10.0, lag=0.4, delay=0.2, advance=0.05, exponent=1.3,
                            full_input=250.0, reverse_ratio=0.7)  # fmt: skip
TRANSIENT, STEADY = 2.0, 60.0


def written(path, model):
    write_manoeuvring_model(path, IdentifiedManoeuvringModel(
        model, (), np.zeros((0, 0)), np.ones(3), Region(0.0, 2.0, 0.5, 0.5, -250.0, 250.0, 500.0)))
    return str(path)


def exported(capsys, *words):
    assert main(['export', *words]) == 0
    return capsys.readouterr()


def numbers_of(plugin):
    return {e.tag: float(e.text) for e in plugin if e.tag not in ('link_name', 'disable_coriolis', 'default_current')}


def stepped(force, mass, inertia, port, starboard, arm, duration, step=0.01):
    """Final u, v, r of a rigid body under plugin forces that see the acceleration of the step before.

    ``force(nu, before)`` is what the plugin pushes with; the semi-implicit rule of the physics engines.
    """
    body, nu, before = np.array([mass, mass, inertia]), np.zeros(3), np.zeros(3)
    drive = np.array([port + starboard, 0.0, arm * (starboard - port)])
    for _ in range(round(duration / step)):
        u, v, r = nu
        before = (force(nu, before) + drive + mass * np.array([v * r, -u * r, 0.0])) / body
        nu = nu + step * before
    return nu


def gazebo_force(values):
    """The Hydrodynamics plugin of gz-sim 8 in the plane, Coriolis switched off."""
    rows, columns = 'xyn', 'UVR'
    added = np.array([[values.get(f'{i}Dot{j}', 0.0) for j in columns] for i in rows])
    linear = np.array([[values.get(i + j, 0.0) for j in columns] for i in rows])
    signed = np.array([[[values.get(i + j + k, 0.0) for k in columns] for j in columns] for i in rows])
    absolute = np.array([[[values.get(f'{i}{j}abs{k}', 0.0) for k in columns] for j in columns] for i in rows])
    return lambda nu, before: added @ before + (linear + signed @ nu + absolute @ np.abs(nu)) @ nu


def vrx_force(values):
    """SimpleHydrodynamics of VRX: diagonal, Coriolis computed but not applied."""
    added, linear, quadratic = (np.array([values[n] for n in names]) for names in (
        ('xDotU', 'yDotV', 'nDotR'), ('xU', 'yV', 'nR'), ('xUU', 'yVV', 'nRR')))
    return lambda nu, before: -added * before - (linear + quadratic * np.abs(nu)) * nu


def last_of(model, port, starboard, duration=STEADY):
    steps = round(duration / 0.1)
    run = simulate(model, np.full(steps, port), np.full(steps, starboard), 0.1)
    return np.array([run.u[-1], run.v[-1], run.yaw_rate[-1]])


INPUTS = pytest.mark.parametrize('port, starboard', [(150.0, 150.0), (220.0, 90.0), (60.0, 200.0)])
DURATIONS = pytest.mark.parametrize('duration', [TRANSIENT, STEADY])
"""s; inertia and added mass show in the first, damping in the second."""


@DURATIONS
@INPUTS
def test_gazebos_own_equations_come_back_to_the_craft(port, starboard, duration):
    tree = ElementTree.fromstring(gazebo(CROSSED).text)
    plugins = tree.findall('model/plugin')
    assert [(p.get('filename'), p.get('name')) for p in plugins] == [
        ('gz-sim-hydrodynamics-system', 'gz::sim::systems::Hydrodynamics'),
        *2 * [('gz-sim-thruster-system', 'gz::sim::systems::Thruster')],
    ]
    assert plugins[0].findtext('disable_coriolis') == 'true'
    assert [p.findtext('joint_name') for p in plugins[1:]] == ['port_joint', 'starboard_joint']
    left, right = 0.9 * 0.97 * port, 0.9 * 1.03 * starboard
    assert float(plugins[1].findtext('max_thrust_cmd')) == pytest.approx(0.9 * 0.97 * 250.0)
    inertial = tree.find('model/link/inertial')
    found = stepped(gazebo_force(numbers_of(plugins[0])), float(inertial.findtext('mass')),
                    float(inertial.findtext('inertia/izz')), left, right, 1.2 * 1.027135 / 0.9, duration)
    assert found == pytest.approx(last_of(CROSSED, port, starboard, duration), rel=0.003, abs=1e-3)


@DURATIONS
@INPUTS
def test_vrxs_own_equations_come_back_to_the_craft(port, starboard, duration):
    plugin = ElementTree.fromstring(vrx(DIAGONAL).text)
    assert (plugin.get('filename'), plugin.get('name')) == ('libSimpleHydrodynamics.so', 'vrx::SimpleHydrodynamics')
    values = numbers_of(plugin)
    assert min(values.values()) >= 0.0
    found = stepped(vrx_force(values), 180.0, 446.0, port, starboard, 1.027135, duration)
    assert found == pytest.approx(last_of(DIAGONAL, port, starboard, duration), rel=0.003, abs=1e-3)


@DURATIONS
@INPUTS
def test_fossens_matrices_come_back_to_the_craft_cubic_terms_and_all(port, starboard, duration, tmp_path, capsys):
    model = CUBIC.with_values(lag=0.0, delay=0.0, N0=3.0, X0=-2.0)
    said = exported(capsys, written(tmp_path / 'm.yaml', model), '--to', 'fossen')
    assert said.err == ''
    text = {}
    exec(said.out, text)  # noqa: S102
    nu, step = np.zeros(3), 0.05
    for _ in range(round(duration / step)):
        slope = text['acceleration'](nu, port, starboard)
        nu = nu + step * text['acceleration'](nu + 0.5 * step * slope, port, starboard)
    assert nu == pytest.approx(last_of(model, port, starboard, duration), rel=0.005, abs=1e-3)
    assert text['thrust'](-100.0) == pytest.approx(-0.7 * 250.0 * 0.4**1.3)


def test_what_a_target_drops_is_said_in_the_file_and_on_the_terminal(tmp_path, capsys):
    source = written(tmp_path / 'm.yaml', CUBIC)
    said = exported(capsys, source, '--to', 'gazebo', '--output', str(tmp_path / 'm.sdf'))
    text = (tmp_path / 'm.sdf').read_text()
    for name in ('Xuuu', 'Nrrr', 'Nuur', 'advance', 'lag', 'delay'):
        assert f'{name} = ' in said.err and f'{name} = ' in text
    reduced, dropped = expressed(CUBIC, GAZEBO)
    assert set(dropped) == {'Xuuu', 'Nrrr', 'Nuur', 'advance', 'lag', 'delay'}
    whole, part = (run_test('turning-circle', m).numbers['steady_diameter_m'] for m in (CUBIC, reduced))
    assert abs(part / whole - 1.0) > 0.05
    assert f'steady_diameter_m {whole:.4g} and {part:.4g} ({part / whole - 1.0:+.1%})' in said.err
    assert 'zigzag' in said.err
    assert ElementTree.fromstring(text).tag == 'sdf'
    assert 'Yuv = ' in exported(capsys, source, '--to', 'vrx').err
    assert [a.code for a in vrx(replace(DIAGONAL, current=(0.2, 0.0))).advice] == ['current-not-exported']


def test_nothing_is_warned_of_where_nothing_is_dropped():
    assert gazebo(CROSSED).advice == () and vrx(DIAGONAL).advice == ()


def test_added_mass_beyond_mass_is_warned_of():
    heavy = NEW.with_values(Yv_dot=-200.0)
    assert 'added-mass-diverges' in [a.code for a in vrx(heavy).advice]
    plugin = ElementTree.fromstring(vrx(heavy).text)
    with np.errstate(all='ignore'):
        assert not np.all(np.isfinite(stepped(vrx_force(numbers_of(plugin)), 180.0, 446.0, 220.0, 90.0, 1.0, STEADY)))


def test_nav2_limits_are_within_what_the_craft_does():
    model = NEW.with_values(lag=0.4, delay=0.2)
    found = nav2(model)
    content = yaml.safe_load(found.text)
    follow = content['controller_server']['ros__parameters']['FollowPath']
    smoother = content['velocity_smoother']['ros__parameters']
    table = content['craft']['ros__parameters']
    assert follow['plugin'] == 'nav2_mppi_controller::MPPIController'
    assert follow['model_delay_vx'] == follow['model_delay_wz'] == pytest.approx(0.6)
    # steady speed of (1.5 x 250 N) = 100 u + 150 u^2
    speed = (-100.0 + np.sqrt(100.0**2 + 4.0 * 150.0 * 375.0)) / 300.0
    assert follow['vx_max'] == pytest.approx(speed, rel=0.002)
    assert smoother['max_velocity'] == [follow['vx_max'], 0.0, follow['wz_max']]
    assert smoother['max_accel'][0] == follow['ax_max'] > 0.0 > follow['ax_min'] == smoother['max_decel'][0]
    # from rest the force alone sets the acceleration, so that the mean over a rise is less
    assert 0.3 * 375.0 / 180.0 < follow['ax_max'] < 375.0 / 180.0
    u, v, r = last_of(model, 125.0, 250.0)
    assert table['yaw_rate_rad_s'][-1] == pytest.approx(r, rel=0.01)
    assert table['turn_radius_m'][-1] == pytest.approx(np.hypot(u, v) / r, rel=0.01)
    assert follow['wz_max'] <= min(table['yaw_rate_rad_s'])
    # a unicycle that turns at the table's speed and yaw rate goes round on its radius
    heading = np.linspace(0.0, 2.0 * np.pi, 2001)
    step = table['turning_speed_m_s'][0] / table['yaw_rate_rad_s'][0] * np.diff(heading)
    across = np.max(np.cumsum(step * np.sin(heading[:-1])))
    assert across == pytest.approx(2.0 * table['turn_radius_m'][0], rel=0.01)
    assert all(np.diff(table['stopping_distance_m']) > 0.0)
    assert [a.code for a in found.advice] == ['motion-simplified']


def test_roll_damping_of_a_hull(tmp_path, capsys):
    model = PUBLISHED_HULLS['swath-roll'].model
    found = gazebo_attitude({'roll': IdentifiedModel.exactly(model)}, {'roll': 2.0})
    tree = ElementTree.fromstring(found.text)
    values, ixx = numbers_of(tree.find('model/plugin')), float(tree.findtext('model/link/inertial/inertia/ixx'))
    rate = 0.3
    acceleration = (values['kP'] + values['kPabsP'] * rate) * rate / ixx
    assert acceleration == pytest.approx(model.acceleration(0.0, rate) + model.terms['b3'] * rate**3)
    assert [a.code for a in found.advice] == ['restoring-not-exported', 'terms-dropped']
    write_model(tmp_path / 'roll.yaml', {'roll': IdentifiedModel.exactly(model)})
    text = {}
    exec(exported(capsys, str(tmp_path / 'roll.yaml'), '--to', 'fossen', '--inertia', 'roll=2').out, text)  # noqa: S102
    moment = text['roll_damping'](rate) + text['roll_restoring'](0.2)
    assert -moment / text['roll_inertia'] == pytest.approx(model.acceleration(0.2, rate))


@pytest.mark.parametrize('words, sentence', [
    (['missing.yaml', '--to', 'vrx'], 'missing.yaml'),
    (['roll.yaml', '--to', 'gazebo'], '--inertia roll='),
    (['roll.yaml', '--to', 'nav2'], 'takes no roll or pitch model'),
    (['roll.yaml', '--to', 'fossen', '--inertia', 'roll=-1'], 'greater than zero'),
    (['craft.yaml', '--to', 'vrx', '--inertia', 'roll=1'], 'leave it out'),
    (['craft.yaml', '--to', 'vrx', '--output', 'craft.yaml'], 'craft.yaml'),
])  # fmt: skip
def test_bad_input_is_one_sentence(words, sentence, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written(tmp_path / 'craft.yaml', replace(NEW, name='a -- <b>'))
    write_model(tmp_path / 'roll.yaml', {'roll': IdentifiedModel.exactly(PUBLISHED_HULLS['swath-roll'].model)})
    before = sorted(tmp_path.iterdir())
    assert main(['export', *words]) == 2
    said = capsys.readouterr()
    assert said.out == '' and sentence in said.err and said.err.count('\n') == 1
    assert sorted(tmp_path.iterdir()) == before


def test_odd_names_stay_xml():
    assert ElementTree.fromstring(gazebo(replace(NEW, name='a -- "<b>')).text).find('model').get('name') == 'a -- "<b>'
