"""From measured manoeuvres to a manoeuvring model: assembly of runs, shooting, selection, validation."""
