"""From a model and the motion so far to what comes: filters, their blend, forecasts, calm, skill.

The one filter is stepped sample by sample; fits of the sea are handed in from outside.
"""
