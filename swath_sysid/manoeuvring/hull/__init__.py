"""The manoeuvring models: derivatives, thrust, simulation, standard manoeuvres, stability."""
