"""Obstacles: the safety corridor, and what is remembered."""
