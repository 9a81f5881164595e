"""What was measured: attitude, trials, windows, quality, installation of the sensor, decays.

Independent of any model of the hull; identification and prediction take their samples from here.
"""
