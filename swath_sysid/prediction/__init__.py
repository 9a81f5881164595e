"""From believed to expected: filter, excitation, forecast, skill."""
