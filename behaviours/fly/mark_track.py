"""The landing mark as it is tracked: whether it is believed, and how it is flown to."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from uav_bt.answers import FollowLeg, Rotate
from uav_bt.board import HELIPAD, SITE_MAP
from uav_bt.board.blackboard import Key
from uav_bt.tree import Leaf
from uav_bt.types import HelipadFix
from uav_bt.types.site_map import MapMark

MARK_GONE: Final = Key(
    "mark_gone_s",
    float,
    "capture up to which sightings of the map's mark did not lead to it",
    unit="s",
    writer="SearchByMap",
)
TRACK_TRIED: Final = Key(
    "track_tried_s",
    float,
    "capture up to which sightings of the track did not lead to the mark",
    unit="s",
    writer="StopAboveMark",
)
TRACK_KEYS: Final = (HELIPAD, SITE_MAP, MARK_GONE)
"""Keys that a leaf must declare that it reads, to fly to the mark by its track."""


@dataclass(frozen=True, kw_only=True)
class TrackConfig:
    """When a track is flown to, and how. The numbers were chosen in flights on the training scenes.

    Attributes:
        carried_std_m: A track without a new sighting is flown to below this deviation.
        agrees_m: A sighting further from the map's mark than this is another thing.
        lost_s: A track is lost without a sighting for this time. Flying round a box takes a while.
        ahead_rad: The drone advances below this error of its heading.
        fast_mps: Highest speed on the straight way.
        slow_down_per_s: Speed per metre of remaining range.
        out_of_view_s: The mark is out of view without a sighting for this time, the 15 frames of
            the paper.
        close_m: Nearer than this, a mark out of view left it by the lower edge.
        at_mark_m: Nearer than this, obstacles in view stand beside the mark or behind it.
        look_down_m: Nearer than this the camera looks down at obstacles of unknown range.
        clear_m: Distance from the straight way that obstacles keep in the last metre. The approach
            has shown them from nearby.
    """

    carried_std_m: float = 0.3
    agrees_m: float = 0.7
    lost_s: float = 20.0
    ahead_rad: float = math.radians(12)
    fast_mps: float = 0.45
    slow_down_per_s: float = 0.6
    out_of_view_s: float = 0.5
    close_m: float = 1.6
    at_mark_m: float = 0.5
    look_down_m: float = 1.5
    clear_m: float = 0.32


TRACK: Final = TrackConfig()


def mark_of(leaf: Leaf) -> MapMark | None:
    """Return the map's mark: seen, and not looked for in vain since.

    Args:
        leaf: Declares `TRACK_KEYS`.
    """
    site_map, gone_s = leaf.read(SITE_MAP).value, leaf.read(MARK_GONE).value
    mark = None if site_map is None else site_map.mark
    return mark if mark is not None and (gone_s is None or mark.seen_s > gone_s) else None


def believed_fix(leaf: Leaf) -> HelipadFix | None:
    """Return the track while it is not lost and a mark may be there; else None.

    A mark may be near the map's mark, and on a map without one anywhere but beyond the ground's
    edge: a mask may take something far behind that edge for the mark.

    Args:
        leaf: Declares `TRACK_KEYS`.
    """
    fix, site_map = leaf.read(HELIPAD).value, leaf.read(SITE_MAP).value
    if fix is None or leaf.clock.now() - fix.captured_s > TRACK.lost_s:
        return None
    if site_map is None:
        return fix
    x_m, y_m = site_map.pose.to_world(fix.forward_m, fix.right_m)
    mark = mark_of(leaf)
    if mark is None:
        return None if site_map.is_beyond_edge(x_m, y_m) else fix
    apart_m = math.hypot(x_m - mark.x_m, y_m - mark.y_m)
    return fix if apart_m <= TRACK.agrees_m else None


def is_clear(leaf: Leaf, fix: HelipadFix) -> bool:
    """Return whether no obstacle that was seen stands on the straight way to the mark.

    Args:
        leaf: Declares `TRACK_KEYS`.
        fix: The track.
    """
    reading = leaf.read(SITE_MAP)
    if reading.value is None:  # a tree may do without; a stale reading permits nothing
        return math.isinf(reading.age_s)
    near = reading.value.near
    return near.allows(fix.forward_m, fix.right_m, margin_m=TRACK.clear_m, assumed=False)


def is_at_mark(fix: HelipadFix, now_s: float, close_m: float = TRACK.close_m) -> bool:
    """Return whether the last metre begins: the mark is near, or has left the view below.

    Args:
        fix: The track.
        now_s: Time of the mission clock.
        close_m: Nearer than this, a mark out of view left it by the lower edge.
    """
    below = now_s - fix.captured_s > TRACK.out_of_view_s and abs(fix.bearing_rad) < TRACK.ahead_rad
    return fix.range_m <= TRACK.at_mark_m or (below and fix.range_m < close_m)


def straight_to(fix: HelipadFix, *, most_m: float = math.inf) -> FollowLeg | Rotate:
    """Return the straight course to the mark.

    Args:
        fix: The track.
        most_m: The way ahead is free up to this distance.
    """
    reason = f"mark {fix.range_m:.1f} m"
    speed_mps = min(TRACK.fast_mps, TRACK.slow_down_per_s * min(fix.range_m, most_m))
    if abs(fix.bearing_rad) >= TRACK.ahead_rad or speed_mps <= 0.0:
        return Rotate(yaw_rad=fix.bearing_rad, reason=reason)
    return FollowLeg(yaw_rad=fix.bearing_rad, speed_mps=speed_mps, reason=reason)
