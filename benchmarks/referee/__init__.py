"""States what changed between two installed programs, by their commands and files."""
