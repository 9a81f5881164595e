"""Health of the forecasts of surge, sway and yaw."""

from swath_sysid.common.conventions import ADEQUATE
from swath_sysid.manoeuvring.prediction.pipeline import REASONS, ManoeuvreOutlook
from swath_sysid.pipeline.health import ERROR, OK, WARN, Reasons, Report, verdict_values


class ManoeuvringHealth(Reasons):
    """How odometry becomes forecasts."""

    def __init__(self, topic: str, pipeline: ManoeuvreOutlook):
        super().__init__(pipeline.counts, REASONS)
        self._topic = topic
        self._pipeline = pipeline
        self._received = self._bad_models = 0
        self._arrival: float | None = None
        self._refusal = ''

    def note_message(self, now: float) -> None:
        """Odometry came, s of the clock of `reports`."""
        self._received += 1
        self._arrival = now

    def note_model(self) -> None:
        """A model came."""
        self._refusal = ''

    def note_refused_model(self, sentence: str) -> None:
        """A model cannot be used, for this reason; it is reported until a good one comes."""
        self._bad_models += 1
        self._refusal = sentence

    def reports(self, now: float) -> list[Report]:
        """The report now, s, and start a new period."""
        fresh = self.fresh(self._pipeline.counts)
        level, text = OK, 'forecasting with the identified model'
        model = self._pipeline.identified
        if self._arrival is None or now - self._arrival > self._pipeline.settings.gap_limit:
            level, text = ERROR, f'no odometry on {self._topic}: check that it is published there, or remap the topic'
        elif fresh:
            level, text = WARN, self.worst(fresh)
        elif self._refusal:
            level, text = WARN, f'{self._refusal}; the previous model stays'
        elif not self._pipeline.has_model:
            level = WARN
            text = 'no model yet, steady motion is assumed: give model_file, or publish one on manoeuvring/model'
        elif model is not None and model.verdict not in ('', ADEQUATE):
            level, text = WARN, f'the model is {model.verdict}: {model.verdict_sentence}'
        values: dict[str, object] = {
            'received': self._received,
            'bad_models': self._bad_models,
            'refused_model': self._refusal,
            **verdict_values({'manoeuvring': model}),
            **self._pipeline.counts,
        }
        return [Report('manoeuvre', level, text, values)]
