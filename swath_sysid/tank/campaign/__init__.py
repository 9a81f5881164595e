"""Many trials as one: manifest, tasks and their results, what is chosen and merged. Reads and writes its files through
formats; report draws what comes out.
"""
