"""Depth from one camera: a network, the ground plane, and the scale that joins them."""
