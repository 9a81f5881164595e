"""The public names of the wing: their examples run."""

import pytest
from hostile_manoeuvring_models import manoeuvring_text
from test_public_api import NAMES, running_examples

from swath_sysid.manoeuvring.formats.csv import write_manoeuvring_csv
from swath_sysid.manoeuvring.hull.model import preset
from swath_sysid.manoeuvring.hull.standard_tests import SensorNoise, trial_programme, with_noise


@pytest.fixture(scope='module')
def folder_of_examples(tmp_path_factory):
    folder = tmp_path_factory.mktemp('examples')
    (folder / 'runs').mkdir()
    craft = preset('wamv-vrx-new')
    for seed, name in enumerate(('zigzag_20', 'mixed')):
        manoeuvre = with_noise(trial_programme(craft)[name], SensorNoise(), seed)
        write_manoeuvring_csv(folder / 'runs' / f'{name}.csv', manoeuvre, craft)
    (folder / 'wamv.yaml').write_text(manoeuvring_text(), encoding='utf-8')
    return folder


test_every_public_name_has_an_example_that_runs = running_examples(NAMES['manoeuvring'])
