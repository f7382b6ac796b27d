"""Anything that flies: the MuJoCo twin, and the bridges to real drones."""
