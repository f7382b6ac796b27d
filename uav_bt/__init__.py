"""Behaviour-tree missions for small camera drones."""

__version__ = "0.1.0"
