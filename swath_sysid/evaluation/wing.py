"""What the evaluation wing hands in to the core."""

from swath_sysid.common.wings import Wing

WING = Wing(name='evaluation', order=3, shown_in_demo='evaluation.cli.forecast forecast_sea')
