"""Filters, forecasts and their weighted average, calm windows and skill, from a model and the motion so far.

Filters are stepped sample by sample; fits of the sea come from outside.
"""
