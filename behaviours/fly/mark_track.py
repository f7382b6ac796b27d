"""Track of the landing mark: when it is trusted, and the straight course to it."""

from __future__ import annotations

import math
from typing import Final

from uav_bt.answers import FollowLeg, Rotate
from uav_bt.board import MARK, SITE_MAP
from uav_bt.tree import Leaf
from uav_bt.types import MarkFix

TRACK_KEYS: Final = (MARK, SITE_MAP)  # a leaf must declare them as read to fly to the mark

# The numbers were chosen in flights on the training scenes.
_AGREES_M: Final = 0.7  # a sighting further than this from the map's mark is not the mark
_LOST_S: Final = 20.0  # a track without a sighting is lost; long enough to fly around a box
AHEAD_RAD: Final = math.radians(12)  # the drone advances if its heading error is smaller
_FAST_MPS: Final = 0.45  # highest speed on the straight path
SLOW_DOWN_PER_S: Final = 0.6  # speed per metre of remaining range
# Least distance of obstacles from the straight path in the last metre. The approach has shown them
# from nearby.
_CLEAR_M: Final = 0.32


def believed_fix(leaf: Leaf, mark_m: float) -> MarkFix | None:
    """Return where the mark is by its track, or, when that is lost, by the map; None if unknown.

    A track near the map's mark is plausible. Without a mark on the map, it is anywhere but beyond
    the edge of the ground: a mask may mistake something far behind that edge for the mark.

    Args:
        leaf: A leaf that declares `TRACK_KEYS`.
        mark_m: Height of the mark's top above the ground.
    """
    fix, site_map = leaf.read(MARK).value, leaf.read(SITE_MAP).value
    if fix is not None and leaf.clock.now() - fix.captured_s > _LOST_S:
        fix = None
    if site_map is None:
        return fix
    mark, at_m = site_map.mark, None
    if fix is not None:
        at_m = site_map.pose.to_world(fix.forward_m, fix.right_m)
    if mark is None:
        return None if at_m is None or site_map.is_beyond_edge(*at_m) else fix
    if at_m is not None and math.dist(at_m, (mark.x_m, mark.y_m)) <= _AGREES_M:
        return fix
    forward_m, right_m = site_map.pose.to_body(mark.x_m, mark.y_m)
    return MarkFix(
        captured_s=mark.seen_s,
        forward_m=forward_m,
        right_m=right_m,
        height_m=mark_m,
        detected=False,
        std_m=mark.std_m,
    )


def is_clear(
    leaf: Leaf,
    forward_m: float,
    right_m: float,
    *,
    margin_m: float = _CLEAR_M,
    assumed: bool = False,
) -> bool:
    """Return whether no seen, or assumed, obstacle is near the straight path to a place."""
    reading = leaf.read(SITE_MAP)
    if reading.value is None:  # a tree may lack a map; a stale map permits nothing
        return math.isinf(reading.age_s)
    return reading.value.near.allows(forward_m, right_m, margin_m=margin_m, assumed=assumed)


def straight_to(fix: MarkFix, *, most_m: float = math.inf) -> FollowLeg | Rotate:
    """Return the straight course to the mark; the path ahead is free up to a distance."""
    reason = f"mark {fix.range_m:.1f} m"
    speed_mps = min(_FAST_MPS, SLOW_DOWN_PER_S * min(fix.range_m, most_m))
    if abs(fix.bearing_rad) >= AHEAD_RAD or speed_mps <= 0.0:
        return Rotate(yaw_rad=fix.bearing_rad, reason=reason)
    return FollowLeg(yaw_rad=fix.bearing_rad, speed_mps=speed_mps, reason=reason)
