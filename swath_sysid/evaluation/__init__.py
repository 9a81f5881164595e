"""Forecasts compared: scores, baselines, decisions, and how they are shown; a wing, which the core can do without."""
