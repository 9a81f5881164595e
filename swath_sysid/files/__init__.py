"""Bags, CSV trials, MTi exports and model files."""
