"""Depth of upright faces from their contact with the ground."""
