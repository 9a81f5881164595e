"""What was measured under way: runs with their commands, cleaned and checked for signs and frames.

Live, the window of such samples.
"""
