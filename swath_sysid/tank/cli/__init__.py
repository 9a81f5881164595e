"""Verbs of the tank wing, and what it adds to those of the core."""
