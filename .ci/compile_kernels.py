"""Compiles every kernel into the cache, once: otherwise each of the processes that use them first would do it."""

from swath_sysid.attitude.identification import refit
from swath_sysid.manoeuvring.identification import refit as manoeuvring
from swath_sysid.pipeline import forecast_pipeline

for room in (refit, forecast_pipeline, manoeuvring):
    room.warm_up()
