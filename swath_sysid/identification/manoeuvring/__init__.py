"""From measured manoeuvres to a manoeuvring model."""
