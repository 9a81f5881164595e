"""Exports, each held against the target's own equations, written here again from its sources."""

import json
import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp
from scipy.signal import find_peaks

from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS
from swath_sysid.attitude.hull.decay_model import DecayModel, Equation
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.hull.simulation import simulate as simulate_decay
from swath_sysid.cli.main import main
from swath_sysid.formats.model_file import write_model
from swath_sysid.manoeuvring.formats.export.expressible import expressed
from swath_sysid.manoeuvring.formats.export.gazebo import EXPRESSIBLE as GAZEBO
from swath_sysid.manoeuvring.formats.export.gazebo import gazebo, gazebo_attitude
from swath_sysid.manoeuvring.formats.export.nav2 import nav2
from swath_sysid.manoeuvring.formats.export.vrx import vrx
from swath_sysid.manoeuvring.formats.model_file import write_manoeuvring_model
from swath_sysid.manoeuvring.hull.identified_model import IdentifiedManoeuvringModel, Region
from swath_sysid.manoeuvring.hull.model import preset
from swath_sysid.manoeuvring.hull.simulation import simulate
from swath_sysid.manoeuvring.hull.standard_tests import run_test

NEW = preset('wamv-vrx-new')
DIAGONAL = NEW.with_values(Xu_dot=-20.0, Yv_dot=-60.0, Nr_dot=-150.0, Xvr=20.0, Yur=-60.0)
CROSSED = DIAGONAL.with_values(
    Yr_dot=-20.0, Nv_dot=-60.0, x_G=0.2, Xvr=150.0, Xvv=-120.0, Xrr=-200.0, Yr=-20.0, Yur=-30.0, Yuv=-50.0, Nur=-90.0,
    Nv=-25.0, Nuv=-35.0, Nvr=-150.0, Yvr=-80.0, deduction=0.1, moment_factor=0.2, balance=0.03)  # fmt: skip
CUBIC = CROSSED.with_values(
    Nrrr=-900.0, Nuur=-60.0, Xuuu=-10.0, lag=0.4, delay=0.2, advance=0.05, exponent=1.3, full_input=250.0,
    reverse_ratio=0.7)  # fmt: skip
TRANSIENT, STEADY = 2.0, 30.0
REGION = Region(0.0, 2.0, 0.5, 0.5, -250.0, 250.0, 500.0)


def written(path, model):
    write_manoeuvring_model(path, IdentifiedManoeuvringModel(model, (), np.zeros((0, 0)), np.ones(3), REGION))
    return str(path)


def exported(capsys, *words):
    assert main(['export', *words]) == 0
    return capsys.readouterr()


def numbers_of(plugin):
    return {e.tag: float(e.text) for e in plugin if e.tag not in ('link_name', 'disable_coriolis', 'default_current')}


def stepped(force, mass, inertia, port, starboard, arm, duration, step=0.01, within=None):
    """Final u, v, r of a body under forces that see the step before; ``within``: added mass that DART integrates."""
    added = np.zeros((3, 3)) if within is None else within
    inverse = np.linalg.inv(np.diag([mass, mass, inertia]) + added)
    nu, slope, acceleration = np.zeros((3, 3))
    drive = np.array([port + starboard, 0.0, arm * (starboard - port)])
    for _ in range(round(duration / step)):
        u, v, r = nu
        x, y, _ = added @ nu
        coriolis = np.array([-y * r, x * r, y * u - x * v])  # of the added mass, Kirchhoff's equations
        turning = np.array([v * r, -u * r, 0.0])
        slope = inverse @ (force(nu, slope, acceleration) + drive + mass * turning - coriolis)
        acceleration = slope - turning
        nu = nu + step * slope
    return nu


def gazebo_force(values):
    """The Hydrodynamics plugin of gz-sim 8 in the plane, Coriolis switched off."""
    rows, columns = 'xyn', 'UVR'
    added = np.array([[values.get(f'{i}Dot{j}', 0.0) for j in columns] for i in rows])
    linear = np.array([[values.get(i + j, 0.0) for j in columns] for i in rows])
    signed = np.array([[[values.get(i + j + k, 0.0) for k in columns] for j in columns] for i in rows])
    absolute = np.array([[[values.get(f'{i}{j}abs{k}', 0.0) for k in columns] for j in columns] for i in rows])
    return lambda nu, slope, _: added @ slope + (linear + signed @ nu + absolute @ np.abs(nu)) @ nu


def vrx_force(values):
    """SimpleHydrodynamics of VRX: diagonal, added mass by the acceleration in the world, Coriolis not applied."""
    added, linear, quadratic = (
        np.array([values[n] for n in names])
        for names in (('xDotU', 'yDotV', 'nDotR'), ('xU', 'yV', 'nR'), ('xUU', 'yVV', 'nRR'))
    )
    return lambda nu, _, acceleration: -added * acceleration - (linear + quadratic * np.abs(nu)) * nu


def last_of(model, port, starboard, duration=STEADY):
    steps = round(duration / 0.1)
    run = simulate(model, np.full(steps, port), np.full(steps, starboard), 0.1)
    return np.array([run.u[-1], run.v[-1], run.yaw_rate[-1]])


def thrusts_of_crossed(port, starboard):
    """Of the left and right thruster, N, and their lever, m, by deduction, moment factor and balance of CROSSED."""
    return 0.9 * 0.97 * port, 0.9 * 1.03 * starboard, 1.2 * 1.027135 / 0.9


INPUTS = pytest.mark.parametrize('port, starboard', [(150.0, 150.0), (220.0, 90.0), (60.0, 200.0)])
#: s; inertia and added mass show in the first, damping in the second
DURATIONS = pytest.mark.parametrize('duration', [TRANSIENT, STEADY])


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
    assert plugins[1].findtext('velocity_control') == 'true'
    assert float(plugins[1].findtext('max_thrust_cmd')) == pytest.approx(0.9 * 0.97 * 250.0)
    inertial = tree.find('model/link/inertial')
    masses = float(inertial.findtext('mass')), float(inertial.findtext('inertia/izz'))
    found = stepped(gazebo_force(numbers_of(plugins[0])), *masses, *thrusts_of_crossed(port, starboard), duration)
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


@INPUTS
def test_added_mass_beyond_mass_goes_into_gazebos_link(port, starboard):
    heavy = CROSSED.with_values(Yv_dot=-250.0, Nv_dot=-20.0)
    found = gazebo(heavy)
    assert found.advice == ()
    tree = ElementTree.fromstring(found.text)
    values = numbers_of(tree.find('model/plugin'))
    assert not [name for name in values if 'Dot' in name]
    within = {e.tag: float(e.text) for e in tree.find('model/link/inertial/fluid_added_mass')}
    assert within == {'xx': 20.0, 'yy': 250.0, 'yr': 56.0, 'rr': 150.0}
    added = np.array([[20.0, 0.0, 0.0], [0.0, 250.0, 56.0], [0.0, 56.0, 150.0]])
    for duration in (TRANSIENT, STEADY):
        thrusts = thrusts_of_crossed(port, starboard)
        end = stepped(gazebo_force(values), 180.0, 446.0, *thrusts, duration, within=added)
        assert end == pytest.approx(last_of(heavy, port, starboard, duration), rel=0.003, abs=1e-3)
    assert [a.code for a in gazebo(heavy.with_values(Nv_dot=-60.0)).advice] == ['added-mass-diverges']
    assert 'added-mass-diverges' in [a.code for a in vrx(NEW.with_values(Yv_dot=-200.0)).advice]


def python_craft(text):
    craft = {}
    exec(text, craft)  # noqa: S102
    return craft['acceleration']


def matlab_craft(text):
    """The function in Python, by the few rules that its text needs."""
    text = re.sub(r'%.*', '', text).replace('...\n', ' ').split('\n', 1)[1].rsplit('end', 1)[0]
    rows = r'\[\n(.*?)\n\]'
    text = re.sub(rows, lambda found: f'np.array([[{found[1]}]])'.replace('\n', '], ['), text, flags=re.DOTALL)
    text = text.replace('[port, starboard]', 'np.array([port, starboard])')
    text = re.sub(r'\b(nu|thrust)\((\d)\)', lambda found: f'{found[1]}[{int(found[2]) - 1}]', text)
    for matlab, python in (('.^', '**'), ('.*', '*'), ('max(', 'np.maximum('), ('* nu(:)', '@ nu[:, None]')):
        text = text.replace(matlab, python)
    text = re.sub(r'= M \\ (.*);', r'= np.linalg.solve(M, \1)[:, 0];', text)
    code = compile('\n'.join(line.strip() for line in text.splitlines()), 'matlab', 'exec')

    def acceleration(nu, port, starboard):
        values = {'np': np, 'nu': np.asarray(nu), 'port': port, 'starboard': starboard}
        exec(code, values)  # noqa: S102
        return values['nu_dot']

    return acceleration


@pytest.mark.parametrize('language, craft_of', [('python', python_craft), ('matlab', matlab_craft)])
@DURATIONS
@INPUTS
def test_fossens_matrices_come_back_to_the_craft_cubic_terms_and_all(
    port, starboard, duration, language, craft_of, tmp_path, capsys
):
    model = CUBIC.with_values(lag=0.0, delay=0.0, N0=3.0, X0=-2.0)
    words = [written(tmp_path / 'm.yaml', model), '--to', 'fossen', '--language', language]
    said = exported(capsys, *words)
    assert json.loads(exported(capsys, *words, '--json').out)['text'] == said.out
    assert said.err == ''
    ending = {'python': 'py', 'matlab': 'm'}[language]
    exported(capsys, *words[:3], '--output', str(tmp_path / f'otter.{ending}'))
    of_the_file = {'py': 'import numpy', 'm': 'function [nu_dot, M, C, D, tau] = otter(nu, port, starboard)'}[ending]
    assert of_the_file in (tmp_path / f'otter.{ending}').read_text()
    acceleration, nu, step = craft_of(said.out), np.zeros(3), 0.05
    for _ in range(round(duration / step)):
        nu = nu + step * acceleration(nu + 0.5 * step * acceleration(nu, port, starboard), port, starboard)
    mirrored = nu * [1.0, -1.0, -1.0]  # y to starboard and z down
    assert mirrored == pytest.approx(last_of(model, port, starboard, duration), rel=0.005, abs=1e-3)
    still = acceleration(np.zeros(3), -100.0, -100.0)[0] * (180.0 + 20.0)
    assert still == pytest.approx(-2.0 - 0.9 * 2.0 * 0.7 * 250.0 * 0.4**1.3)


@pytest.mark.long
def test_what_a_target_drops_is_said_in_the_file_and_on_the_terminal(tmp_path, capsys):
    source = written(tmp_path / 'm.yaml', CUBIC)
    said = exported(capsys, source, '--to', 'gazebo', '--output', str(tmp_path / 'm.sdf'))
    text = (tmp_path / 'm.sdf').read_text()
    for name in ('Xuuu', 'Nrrr', 'Nuur', 'advance', 'lag', 'delay'):
        assert f'{name} = ' in said.err and f'{name} = ' in text
    reduced, dropped = expressed(CUBIC, GAZEBO)
    assert set(dropped) == {'Xuuu', 'Nrrr', 'Nuur', 'advance', 'lag', 'delay'}
    whole, part = (run_test('turning-circle', m).numbers['steady_diameter_m'] for m in (CUBIC, reduced))
    assert f'Nur = {reduced["Nur"]:.4g} instead of {CUBIC["Nur"]:.4g}' in said.err
    assert f'steady_diameter_m {whole:.4g} and {part:.4g} ({part / whole - 1.0:+.1%})' in said.err
    assert 'zigzag' in said.err
    assert ElementTree.fromstring(text).tag == 'sdf'
    assert 'Yuv = ' in exported(capsys, source, '--to', 'vrx').err
    # damping by the speed squared is stood in for at the speed of approach
    swift = DIAGONAL.with_values(Nuur=-200.0)
    approach = run_test('turning-circle', swift).numbers['approach_speed_m_s']
    assert expressed(swift, GAZEBO)[0]['Nur'] == pytest.approx(swift['Nur'] - 200.0 * approach)
    assert [a.code for a in vrx(replace(DIAGONAL, current=(0.2, 0.0))).advice] == ['current-not-exported']


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


def decay_in_gazebo(text, axis, stiffness, angle, time):
    """Angles of gz-sim's damping on a link that buoyancy holds up with a stiffness, N m/rad."""
    tree = ElementTree.fromstring(text)
    values = numbers_of(tree.find('model/plugin'))
    letter, rate, diagonal = {'roll': ('k', 'P', 'ixx'), 'pitch': ('m', 'Q', 'iyy')}[axis]
    inertia = float(tree.findtext(f'model/link/inertial/inertia/{diagonal}'))
    linear, quadratic = (values.get(f'{letter}{rate}{more}', 0.0) for more in ('', f'abs{rate}'))

    def slope(_, y):
        return [y[1], ((linear + quadratic * abs(y[1])) * y[1] - stiffness * y[0]) / inertia]

    return solve_ivp(slope, (0.0, time[-1]), [angle, 0.0], t_eval=time, rtol=1e-8, atol=1e-10).y[0]


@pytest.mark.parametrize('axis', ['roll', 'pitch'])
def test_gazebos_own_equation_gives_the_hulls_decay(axis):
    ratios = {'b1': 0.12, 'b2': 0.6, 'r1': 4.0}
    model = DecayModel.from_terms(Equation('q', tuple(ratios)), ratios, axis=axis)
    found = gazebo_attitude({axis: IdentifiedModel.exactly(model)}, {axis: 2.0})
    assert [a.code for a in found.advice] == ['restoring-not-exported'] and '8 N m/rad' in found.advice[0].message
    time = np.linspace(0.0, 10.0, 201)
    expected, _ = simulate_decay(model, 0.2, 0.0, time)
    np.testing.assert_allclose(decay_in_gazebo(found.text, axis, 8.0, 0.2, time), expected, atol=1e-5)


def test_what_gazebo_makes_of_a_cubic_hulls_decay_is_said(tmp_path, capsys):
    model = PUBLISHED_HULLS['swath-roll'].model
    identified = replace(IdentifiedModel.exactly(model), amplitude_range=(0.01, np.radians(8.0)))
    write_model(tmp_path / 'roll.yaml', {'roll': identified})
    said = exported(capsys, str(tmp_path / 'roll.yaml'), '--to', 'gazebo', '--inertia', 'roll=2')
    tree = ElementTree.fromstring(said.out)
    moments = {e.tag: float(e.text) for e in tree.find('model/link/inertial/inertia')}
    # SDF refuses moments of which two together are less than the third
    assert [moments[name] for name in ('ixx', 'iyy', 'izz')] == [2.0] * 3
    time = np.linspace(0.0, 5.0 * model.natural_period, 20001)
    whole = simulate_decay(model, np.radians(8.0), 0.0, time)[0]
    part = decay_in_gazebo(said.out, 'roll', 2.0 * model.natural_frequency**2, np.radians(8.0), time)
    thirds = [find_peaks(motion)[0][2] for motion in (whole, part)]
    heights = [np.degrees(motion[third]) for motion, third in zip((whole, part), thirds, strict=True)]
    for words in (said.err, said.out):
        pattern = r'crest 3 of a decay from 8 deg, .* have time_s (\S+) and (\S+) .*height_deg (\S+) and (\S+) '
        found = [float(number) for number in re.search(pattern, words).groups()]
        assert found == pytest.approx([*time[thirds], *heights], rel=2e-3)


@pytest.mark.parametrize('axis, side', [('roll', 1.0), ('pitch', -1.0)])
def test_fossens_roll_and_pitch_are_those_of_the_hull_in_his_axes(axis, side, tmp_path, capsys):
    ratios = {'b0': 0.01, 'b1': 0.1, 'b2': 0.3, 'b3': 0.2, 'r1': 4.0, 'r2': 0.7, 'r3': -2.0, 's1': 0.5, 's2': 0.2}
    model = DecayModel.from_terms(Equation('all', tuple(ratios)), ratios, trim=0.05, axis=axis)
    write_model(tmp_path / 'hull.yaml', {axis: IdentifiedModel.exactly(model)})
    words = [str(tmp_path / 'hull.yaml'), '--to', 'fossen', '--inertia', f'{axis}=2']
    text = {}
    exec(exported(capsys, *words).out, text)  # noqa: S102
    moment = text[f'{axis}_damping'](side * 0.3) + text[f'{axis}_restoring'](side * 0.2)
    assert -side * moment / text[f'{axis}_inertia'] == pytest.approx(model.acceleration(0.2, 0.3))
    said = exported(capsys, *words, '--language', 'matlab').out
    forms = (rf's.{axis}_{part} = @\((w|angle)\) (.*);' for part in ('damping', 'restoring'))
    damping, restoring = (re.search(form, said)[2] for form in forms)
    known = {'tanh': np.tanh, 'sin': np.sin, 'abs': abs, 'w': side * 0.3, 'angle': side * 0.2}
    assert eval(f'{damping} + {restoring}', known) == pytest.approx(moment)  # noqa: S307


@pytest.mark.parametrize(
    'words, sentence',
    [
        (['missing.yaml', '--to', 'vrx'], 'missing.yaml'),
        (['roll.yaml', '--to', 'gazebo'], 'inertia of roll in kg m^2, with added inertia (--inertia AXIS=KG_M2)'),
        (['roll.yaml', '--to', 'nav2'], 'cannot express a roll or pitch model'),
        (['roll.yaml', '--to', 'fossen', '--inertia', 'roll=-1'], 'greater than zero'),
        (['craft.yaml', '--to', 'vrx', '--inertia', 'roll=1'], 'leave it out'),
        (['roll.yaml', '--to', 'gazebo', '--inertia', 'roll=1', '--inertia', 'pitch=1'], '--inertia pitch'),
        (['craft.yaml', '--to', 'vrx', '--language', 'matlab'], '--language'),
        (['craft.yaml', '--to', 'fossen', '--output', '1st-craft.m'], "no function name '1st-craft'"),
        (['craft.yaml', '--to', 'vrx', '--output', 'craft.yaml'], 'craft.yaml'),
    ],
)
def test_bad_input_is_one_sentence(words, sentence, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written(tmp_path / 'craft.yaml', replace(NEW, name='a -- <b>'))
    write_model(tmp_path / 'roll.yaml', {'roll': IdentifiedModel.exactly(PUBLISHED_HULLS['swath-roll'].model)})
    before = sorted(tmp_path.iterdir())
    assert main(['export', *words]) == 2
    said = capsys.readouterr()
    assert said.out == '' and sentence in said.err and said.err.count('\n') == 1
    assert sorted(tmp_path.iterdir()) == before
