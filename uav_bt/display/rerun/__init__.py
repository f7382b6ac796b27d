"""View of a flight in Rerun: images, the lab in 3D, the tree and plots, on one timeline."""
