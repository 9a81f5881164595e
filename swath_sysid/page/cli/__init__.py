"""Its verb, and what it runs beside the nodes."""
