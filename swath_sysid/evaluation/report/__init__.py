"""Scores in words and figures."""
