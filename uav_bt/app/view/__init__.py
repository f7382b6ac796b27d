"""Flights viewed in Rerun, composed: while they are flown (`live`), or records (`recorded`)."""
