"""What was in use before, for a rollback."""

LONGEST = 20  #: Models, or files of them, that are kept.
