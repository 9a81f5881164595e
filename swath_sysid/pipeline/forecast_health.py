"""Health of the forecasts, and whether the sensor is mounted as given."""

from math import isnan

from swath_sysid.attitude.motion.installation_watch import InstallationCheck
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.pipeline import health
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline

EXPECTED = {'no-model', 'no-waves'}  #: Codes of advice about what a start lacks, or a craft that never was released.


class PredictorHealth(health.StreamHealth):
    """How samples become forecasts; see `StreamHealth`."""

    def __init__(self, topic: str, pipeline: ForecastPipeline):
        super().__init__(topic, 'predictor')
        self._pipeline = pipeline
        self._model_arrival: float | None = None
        self._refusal = ''
        self.published = 0  #: Forecasts on forecast/next.
        self.slower_because = ''
        self.compiled_share: float | None = None  #: Of the functions that are being compiled; None: none are.
        self._forecast_age = 0.0

    def note_predictors(self, count: int) -> None:
        """Warn while several predictors publish the same forecasts."""
        self.note_while(count > 1, 'several-predictors')

    def note_forecast(self, age: float, stride: int) -> None:
        """A forecast is published, s after its sample came; of so many samples one is used."""
        self._forecast_age = age
        self.details[health.BEHIND] = f'one sample in {stride} is used, newest forecast {age:.1f} s old'

    def note_model(self, now: float) -> None:
        """A model arrived, s of the clock of `note_message`."""
        self._model_arrival = now
        self._refusal = ''

    def note_refused_model(self, sentence: str) -> None:
        """A model cannot be used, for this reason; it is reported until a good one comes."""
        self.note('bad-model')
        self._refusal = sentence

    def reports(self, now: float, now_ns: int) -> list[health.Report]:
        """The statuses of now; see `StreamHealth.report`."""
        state = self._pipeline.diagnostics()
        interval = None if isnan(state.sample_interval) else state.sample_interval
        kept = 'the previous model stays' if any(self._pipeline.models.values()) else 'there is no model'
        refused = [f'{self._refusal}; {kept}'] if self._refusal else []
        compiling = [] if self.compiled_share is None else [f'compiling, {self.compiled_share:.0%} done']
        message = '; '.join([*compiling, *refused, *(advice.message for advice in state.advice)])
        codes = tuple({advice.code for advice in state.advice} - EXPECTED) + ('bad-model',) * len(refused)
        level, message = health.WARN if codes else health.OK, message or 'forecasting with the identified model'
        values: dict[str, object] = {
            **{f'has_model_{axis}': state.has_model[axis] for axis in AXES},
            'model_age_s': 'no model' if self._model_arrival is None else now - self._model_arrival,
            **health.verdict_values(self._pipeline.models),
            'refused_model': self._refusal,
            'has_waves': state.has_waves,
            'published': self.published,
            **{f'valid_lead_{name}_s': lead for name, lead in state.valid_leads.items()},
            'forecast_age_s': self._forecast_age,
            'compiled_share': 1.0 if self.compiled_share is None else self.compiled_share,
            'slower_because': self.slower_because,
            **{f'nis_ratio_{axis}': ratio for axis, ratio in state.nis_ratio.items()},
        }
        names = state.candidates
        for a, axis in enumerate(AXES):
            for number, lead in enumerate(self._pipeline.settings.forecaster.leads):
                values[f'nrmse_{axis}_{lead}s'] = float(state.nrmse[a, number])
                values[f'coverage90_{axis}_{lead}s'] = float(state.coverage[a, number])
                values[f'leading_{axis}_{lead}s'] = names[int(state.weights[:, a, number].argmax())]
                for channel, gain in state.upstream_gain.items():
                    values[f'upstream_gain_{axis}_{lead}s_{channel}'] = float(gain[a, number])
                for k, candidate in enumerate(names):
                    values[f'nrmse_{axis}_{lead}s_{candidate}'] = float(state.candidate_nrmse[k, a, number])
        return [
            self.report(now, now_ns, self._pipeline.counts, self._pipeline.used, interval),
            health.Report('forecast', level, message, values, codes),
            installation_report(self._pipeline.installation),
        ]


def installation_report(check: InstallationCheck) -> health.Report:
    """Whether the sensor is mounted as given; the check judges anew where that is due."""
    found = [health.Finding(health.WARN, each.code, each.message) for each in check.judge()]
    values = {'contradictions': ' '.join(health.codes_of(found)) or 'none', 'judgements': check.judgements}
    return health.Report.of('installation', found, check.described, values)
