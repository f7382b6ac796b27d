"""Recorded flights flown again: what was seen is seen again, and what is decided is compared.

The loop is open: the recorded frames show what the recorded commands led to, whatever is decided
now. So the first difference is one of cause, and later ones may follow from it.
"""

from __future__ import annotations

from uav_bt.app.replay.differences import Difference, ReplayReport
from uav_bt.app.replay.replayer import ReplayOptions, replay

__all__ = ["Difference", "ReplayOptions", "ReplayReport", "replay"]
