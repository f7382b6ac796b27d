"""What holds for all tests."""

from __future__ import annotations

from hypothesis import settings

# No time limit for an example: how fast a machine is belongs in benchmarks.
settings.register_profile("uav-bt", deadline=None)
settings.load_profile("uav-bt")
