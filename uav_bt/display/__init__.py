"""Displays of a flight: status line, lab map, films, Rerun."""
