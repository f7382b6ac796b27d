"""Leaf policies: pure functions from a view to a decision, swappable in the tree file."""
