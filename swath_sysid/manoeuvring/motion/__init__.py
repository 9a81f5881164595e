"""Measured runs with their commands, cleaned and corrected for signs and frames, and the live window of samples."""
