"""From a manoeuvring model to forecasts: filter, forecast, skill, live and offline."""
