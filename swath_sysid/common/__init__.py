"""What is independent of any craft: advice and errors, the optional compiler, noise, covariance, and the searches."""
