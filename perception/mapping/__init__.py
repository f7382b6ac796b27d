"""The site map: what of the place is ground, what stands on it, and where the drone is in it."""
