"""Roll and pitch: measured (motion), modelled (hull), identified (identification), forecast (prediction).

One of two wings with the same inner order; they meet in pipeline, formats and cli only.
"""
