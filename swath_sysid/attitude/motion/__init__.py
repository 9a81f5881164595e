"""What was measured: attitude, trials, windows, quality, installation of the sensor, decays.

Knows no model of the hull: those who fit and those who forecast take their samples from here.
"""
