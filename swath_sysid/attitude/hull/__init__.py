"""The models: terms of damping and restoring, the published catalogue, simulation, identified models."""
