"""Accuracy of metric depth: the tables of the paper, measured on images of the twin."""
