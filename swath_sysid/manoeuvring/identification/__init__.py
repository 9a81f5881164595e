"""From measured manoeuvres to a manoeuvring model: assembly of runs, shooting, selection, validation.

Works on values alone; the searches themselves are in common.
"""
