"""Manoeuvring of a twin-thruster craft: surge, sway and yaw."""
