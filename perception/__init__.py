"""Arrays in, typed results out: segmentation, mark detection and tracking."""
