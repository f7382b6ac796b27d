"""What a flight is judged by: the report of one flight."""
