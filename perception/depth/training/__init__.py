"""Training of the depth network; needs torch."""
