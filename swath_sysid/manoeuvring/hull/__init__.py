"""The manoeuvring models: derivatives, thrust, simulation, standard manoeuvres, stability.

Nothing here is fitted.
"""
