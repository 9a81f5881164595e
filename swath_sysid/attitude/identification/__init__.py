"""From measured motion to a model: objectives, refinement, uncertainty, selection, waves. Works on values alone; the
searches themselves are in common.
"""
