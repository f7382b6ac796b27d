"""View of a flight in Rerun."""
