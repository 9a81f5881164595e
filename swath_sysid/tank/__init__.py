"""Towing tanks: a trial matrix to a report, published studies carried out again, extinction, Froude scaling. A wing:
`wing.py` hands it in to the core; nothing of the core imports it.
"""
