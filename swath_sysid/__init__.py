"""Online motion prediction of small craft: record, identify, forecast."""

__version__ = '0.1.0'
