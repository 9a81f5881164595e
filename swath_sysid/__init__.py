"""Online motion prediction of small craft: record, identify, forecast."""

from importlib import import_module
from os.path import exists, isdir

__version__ = '1.0.0'

TYPE_CHECKING = False  # typing's own is true for type checkers alone, too, but costs an import
if TYPE_CHECKING:
    from swath_sysid.attitude.hull.catalogue import hull_named as hull_named
    from swath_sysid.attitude.hull.craft_simulator import simulated_trial as simulated_trial
    from swath_sysid.attitude.hull.identified_model import IdentifiedModel as IdentifiedModel
    from swath_sysid.attitude.hull.simulation import simulate as simulate
    from swath_sysid.attitude.identification.fit_quality import Verdict as Verdict
    from swath_sysid.attitude.identification.result import Identification as Identification
    from swath_sysid.attitude.identification.result import IdentificationSettings as IdentificationSettings
    from swath_sysid.attitude.motion.intake import ImuReading as ImuReading
    from swath_sysid.attitude.motion.trial import Trial as Trial
    from swath_sysid.attitude.prediction.candidate import Candidate as Candidate
    from swath_sysid.attitude.prediction.forecaster import ForecasterSettings as ForecasterSettings
    from swath_sysid.attitude.prediction.sea_fit import fit_sea as fit_sea
    from swath_sysid.common.advice import Advice as Advice
    from swath_sysid.common.errors import InputError as InputError
    from swath_sysid.evaluation.scoring import Skill as Skill
    from swath_sysid.evaluation.scoring import score as score
    from swath_sysid.formats.identify_records import identify as identify
    from swath_sysid.formats.identify_records import identify_at_sea as identify_at_sea
    from swath_sysid.formats.identify_records import write_model as write_model
    from swath_sysid.formats.model_file import read_model as read_model
    from swath_sysid.formats.reading import read_trial as read_trial
    from swath_sysid.formats.upstream_channels import read_upstream as read_upstream
    from swath_sysid.manoeuvring.formats.csv import read_manoeuvring_csv as read_manoeuvring_csv
    from swath_sysid.manoeuvring.formats.export.fossen import fossen as fossen
    from swath_sysid.manoeuvring.formats.export.gazebo import gazebo as gazebo
    from swath_sysid.manoeuvring.formats.export.nav2 import nav2 as nav2
    from swath_sysid.manoeuvring.formats.export.vrx import vrx as vrx
    from swath_sysid.manoeuvring.formats.model_file import read_manoeuvring_model as read_manoeuvring_model
    from swath_sysid.manoeuvring.identification.identify import identify_manoeuvring as identify_manoeuvring
    from swath_sysid.manoeuvring.identification.settings import ManoeuvringSettings as ManoeuvringSettings
    from swath_sysid.manoeuvring.motion.intake import prepare_runs as prepare_runs
    from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline as ForecastPipeline
    from swath_sysid.pipeline.forecast_pipeline import PipelineSettings as PipelineSettings
    from swath_sysid.pipeline.record_run import run_through as run_through
    from swath_sysid.pipeline.record_run import samples_of as samples_of
    from swath_sysid.share import share_folder as share_folder

#: By public name, its module, as the imports above say: of the rooms that are here, since a wing may be absent.
_HOME_OF: dict[str, str] = {}
with open(__file__, encoding='utf-8') as _own:
    for _words in (line.split() for line in _own if line.startswith(f'    from {__name__}.')):
        _home = _words[1].removeprefix(f'{__name__}.')
        if isdir(_room := f'{__path__[0]}/{_home.partition(".")[0]}') or exists(f'{_room}.py'):
            _HOME_OF[_words[3]] = _home

__all__ = list(_HOME_OF)


if not TYPE_CHECKING:  # a type checker would take every misspelt name for an object

    def __getattr__(name: str) -> object:
        """A public name, its module loaded when it is first asked for: the command line starts without numpy."""
        if name not in _HOME_OF:
            raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
        found = getattr(import_module(f'{__name__}.{_HOME_OF[name]}'), name)
        if not isinstance(found, type):  # classes check in their constructors
            found = import_module(f'{__name__}.common.door').checked(found)
            found.__module__ = __name__
        globals()[name] = found
        return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
