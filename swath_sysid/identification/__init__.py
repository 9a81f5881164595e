"""From measured to believed: objectives, search, refinement, uncertainty, selection."""
