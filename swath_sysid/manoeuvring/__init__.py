"""Surge, sway and yaw of twin-thruster craft: measured, modelled, identified, forecast. A wing: `wing.py` hands it in
to the core; nothing of the core imports it.
"""
