"""Leaves that move the drone."""
