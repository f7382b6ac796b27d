"""Adaptation of a segmentation network to one place: a linear head on its frozen features."""
