"""Replay of recorded flights: recorded observations go in, decisions are compared.

The loop is open: new decisions do not change the recorded frames.
"""

from __future__ import annotations

from uav_bt.app.replay.differences import Difference, ReplayReport
from uav_bt.app.replay.replayer import ReplayOptions, replay

__all__ = ["Difference", "ReplayOptions", "ReplayReport", "replay"]
