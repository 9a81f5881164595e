"""What no craft has is refused, whoever gives it; every hull there is passes."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from swath_sysid.attitude.hull.catalogue import EQUATIONS, PUBLISHED_HULLS
from swath_sysid.attitude.hull.decay_model import DecayModel, Equation
from swath_sysid.attitude.hull.froude import length_ratio, scaled_model
from swath_sysid.attitude.hull.physical_range import RATIO_RANGES, check_physical
from swath_sysid.attitude.hull.terms import TERM_NAMES
from swath_sysid.cli.main import main
from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.physical_range import PARAMETER_RANGES
from swath_sysid.manoeuvring.hull.physical_range import check_physical as check_manoeuvring
from swath_sysid.manoeuvring.hull.presets import PRESETS, preset
from swath_sysid.manoeuvring.hull.terms import INDEX, NAMES


def linear(period, damping_ratio=0.1, **fields):
    """A linear hull of a natural period, s."""
    frequency = 2.0 * math.pi / period
    return DecayModel.from_terms(
        EQUATIONS['linear'], {'b1': 2.0 * damping_ratio * frequency, 'r1': frequency**2}, **fields
    )


@pytest.mark.parametrize(
    'model, words',
    [
        (linear(0.0499), 'natural period in s is 0.0499'),
        (linear(1001.0), 'natural period in s is 1001'),
        (linear(3.0, trim=3.2), 'trim'),
        (linear(3.0, trim=math.nan), 'trim'),
        (linear(3.0, friction_rate=1e-9), 'friction_rate'),
        (linear(3.0, friction_rate=1e9), 'friction_rate'),
        (
            DecayModel.from_terms(Equation('e', ('b0', 'r1')), {'b0': 99.0, 'r1': 9.0}, friction_rate=1e-6),
            'damping at rest',
        ),
    ],
)
def test_what_no_craft_has_is_named(model, words):
    with pytest.raises(InputError, match=words):
        check_physical(model)


@pytest.mark.parametrize('name', TERM_NAMES)
def test_every_ratio_has_both_ends(name):
    values = {'b1': 0.1, 'r1': 9.0}
    for ratio in (math.nextafter(end, side * math.inf) for end, side in zip(RATIO_RANGES[name], (-1, 1), strict=True)):
        values[name] = ratio
        with pytest.raises(InputError, match=f'the ratio {name} is'):
            check_physical(DecayModel.from_terms(Equation('e', tuple(values)), values))


def test_every_craft_there_is_passes():
    for hull in PUBLISHED_HULLS.values():
        for ratio in (1 / 25, 1.0, 25.0, 500.0):
            check_physical(scaled_model(hull.model, ratio))
    for period, damping_ratio in itertools.product((0.0501, 3.0, 999.0), (0.0, 1.9)):
        check_physical(linear(period, damping_ratio))
    # a hull that capsizes is a hull
    check_physical(DecayModel.from_terms(EQUATIONS['odd-cubic'], {'b1': 0.3, 'b2': 0.1, 'r1': -2.0, 'r3': 80.0}))
    for name in PRESETS:
        check_manoeuvring(preset(name))


def test_the_command_line_refuses_ratios_of_no_craft(tmp_path, capsys):
    output = tmp_path / 'trial.csv'
    words = ['simulate', '--equation', 'linear', '--ratio', 'b1=1', '--ratio', 'r1=1e300', '--initial-angle-deg', '5']
    assert main([*words, '--output', str(output)]) == 2
    assert 'the ratio r1 is 1e+300' in capsys.readouterr().err and not output.exists()


def test_what_is_no_length_ratio():
    texts = '1e300 1e-300 1e300000000 1e-300000000 10001 1/10001 0 -3 1/0 nan inf 1e400/1e400 long 1/2/3'.split()
    for text in (*texts, '', '9' * 300):
        with pytest.raises(InputError, match='length ratio') as caught:
            length_ratio(text)
        assert len(str(caught.value)) < 160


@pytest.mark.parametrize('name', NAMES)
def test_every_parameter_has_both_ends(name):
    model = preset('wamv-vrx-old')
    for end, side in zip(PARAMETER_RANGES[name], (-1, 1), strict=True):
        values = model.values.copy()
        values[INDEX[name]] = math.nextafter(end, side * math.inf)
        # past what the model itself refuses, such as a mass below zero
        wrong = object.__new__(ManoeuvringModel)
        object.__setattr__(wrong, 'values', values)
        with pytest.raises(InputError, match=f'the parameter {name} '):
            check_manoeuvring(wrong)


def test_masses_that_are_not_positive_are_refused():
    """Against the eigenvalues of the mass matrix of sway and yaw."""
    model = preset('wamv-vrx-old')
    for coupling in (0.0, 100.0, 280.0, 290.0, 1e4):
        matrix = np.array([[model['m'], -coupling], [-coupling, model['Iz']]])
        coupled = replace(model, values=model.with_values(Yr_dot=coupling, Nv_dot=coupling).values)
        if np.linalg.eigvalsh(matrix)[0] > 0.0:
            check_manoeuvring(coupled)
        else:
            with pytest.raises(InputError, match='Yr_dot'):
                check_manoeuvring(coupled)
