"""Drones: the MuJoCo twin, the loopback ANAFI and the bridge to a real one."""
