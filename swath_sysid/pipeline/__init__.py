"""What every driver of the cores runs: nodes, play-through, scoring and the demonstration. A sample comes in once, in
whatever form it was recorded; estimates, forecasts and requests for fits come out. Nothing here uses a file, a topic or
a clock.
"""
