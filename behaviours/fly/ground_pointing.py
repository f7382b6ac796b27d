"""Leaves that steer lower the camera where it would look beyond the edge of the ground."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from behaviours.path.gimbal_pointing import ground_pitch_rad
from uav_bt.board import CAMERA, ODOMETRY, SITE_MAP
from uav_bt.tree import Port

if TYPE_CHECKING:
    from behaviours.fly.steering import SteeringLeaf

LOOKS_DOWN: Final = Port(
    "looks_down",
    bool,
    default=False,
    doc="lower the camera where, by the site map, it would show little ground to follow",
)


def pitch_showing_ground(leaf: SteeringLeaf, flight_rad: float) -> float:
    """Return the camera's pitch: as in flight, lower where the map says it shows little ground.

    Args:
        leaf: that steers.
        flight_rad: the pitch in flight, negative down.
    """
    site_map, motion = leaf.read(SITE_MAP).value, leaf.read(ODOMETRY).value
    camera, state = leaf.read(CAMERA).value, leaf.state()
    if site_map is None or motion is None or camera is None or state is None:
        return flight_rad
    if site_map.movers:
        return flight_rad  # what moves is to stay in view
    here = site_map.at(motion.pose)
    return ground_pitch_rad(here, camera, flight_rad, state.height_above_carpet_m)
