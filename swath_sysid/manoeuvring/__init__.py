"""Surge, sway and yaw of twin-thruster craft: measured, modelled, identified, forecast.

The second wing, with the inner order of attitude; neither imports the other.
"""
