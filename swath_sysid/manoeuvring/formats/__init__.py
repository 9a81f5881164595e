"""Runs in tables and bags, messages, model files."""
