"""What was measured: attitude, trials, windows, quality, installation of the sensor, decays."""
