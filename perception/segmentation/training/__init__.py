"""Training of the segmentation network; needs torch."""
