"""Frames with telemetry, as training takes them."""
