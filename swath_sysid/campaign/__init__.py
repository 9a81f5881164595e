"""Many trials as one: manifest, tasks and their results, what is chosen and joined.

Reads and writes its files through formats; report draws what comes out.
"""
