"""Odometry: dead reckoning and visual odometry."""
