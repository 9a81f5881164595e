"""What is believed: the decay models, the published catalogue, simulation."""
