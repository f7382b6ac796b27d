"""Arrays in, typed results out: segmentation, helipad detection and tracking."""
