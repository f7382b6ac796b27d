"""Depth of faces that stand on the carpet, from where they touch it."""
