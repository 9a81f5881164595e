"""Surge, sway and yaw of twin-thruster craft: measured, modelled, identified, forecast."""
