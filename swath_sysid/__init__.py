"""Online motion prediction of small craft: record, identify, forecast."""

__version__ = '1.0.0'
