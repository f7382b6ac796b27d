"""The truth, for referees only."""

from __future__ import annotations

from dataclasses import dataclass

from uav_bt.types.pose import Pose


@dataclass(frozen=True, kw_only=True)
class Truth:
    """What only a simulator knows; used by reports and evaluations, never by the mission."""

    time_s: float
    pose: Pose
    contacts: tuple[str, ...]  # geoms the body touches now, the ground and the pad included
    clearance_m: float  # from the hull to the nearest box, inf without boxes
    inside_carpet: bool  # the body's centre
    on_helipad: bool  # the body's centre is above the pad
    landing_error_m: float  # horizontal, body centre to pad centre
    motors_on: bool
