"""From a manoeuvring model to where the craft will be: filter, forecast, skill.

Driven live by its own node and offline by the command line.
"""
