"""The models: terms of damping and restoring, the published catalogue, simulation, identified models.

A model is a choice of terms with their coefficients; nothing here is fitted.
"""
