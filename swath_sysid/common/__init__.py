"""What is independent of any craft: advice and errors, the optional compiler, noise, covariance, and the searches.

The root of the house: every room may use it, and it uses none.
"""
