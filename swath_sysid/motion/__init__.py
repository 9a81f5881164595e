"""What was measured: attitude, trials, windows, quality gates and decays."""
