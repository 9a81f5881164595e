"""Verbs of the manoeuvring wing, and what it adds to those of the core."""
