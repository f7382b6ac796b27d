"""Perception leaves. They tick before the mission's leaves and fill the board."""
