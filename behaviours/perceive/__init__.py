"""Leaves that fill the board: perception runs ahead of the mission."""
