"""Its verb, and what it adds to those of the core."""
