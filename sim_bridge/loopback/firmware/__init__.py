"""Simulated firmware of the ANAFI: turns commands into movements and events.

Each part gets the time as an argument and moves a `World`. This package uses no sockets.
"""
