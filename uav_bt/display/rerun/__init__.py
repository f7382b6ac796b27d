"""Flights in Rerun: images, the lab in 3D, the tree as a graph and plots, on one timeline."""
