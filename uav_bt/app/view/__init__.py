"""Flights viewed in Rerun."""
