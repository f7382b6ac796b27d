"""Films of flights."""
