"""Summaries, figures and pages of the manoeuvring wing."""
