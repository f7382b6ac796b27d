"""Watching a flight: the map, the video, the status line and the summary."""
