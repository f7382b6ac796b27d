"""Track of the landing mark: when it is trusted, and the straight course to it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from uav_bt.answers import FollowLeg, Rotate
from uav_bt.board import MARK, SITE_MAP
from uav_bt.board.blackboard import Key
from uav_bt.tree import Leaf
from uav_bt.types import MarkFix
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
TRACK_KEYS: Final = (MARK, SITE_MAP, MARK_GONE)
"""Keys that a leaf must declare as read to fly to the mark by its track."""


@dataclass(frozen=True, kw_only=True)
class TrackConfig:
    """Limits for using a track. The numbers were chosen in flights on the training scenes.

    Attributes:
        carried_std_m: Largest standard deviation of a usable track without a new sighting.
        agrees_m: A sighting further than this from the map's mark is not the mark.
        lost_s: A track is lost without a sighting for this time, long enough to fly around a box.
        ahead_rad: The drone advances if its heading error is smaller.
        fast_mps: Highest speed on the straight path.
        slow_down_per_s: Speed per metre of remaining range.
        out_of_view_s: The mark is out of view without a sighting for this time, the 15 frames of
            the paper.
        close_m: A mark out of view and nearer than this has left the view by the lower edge.
        at_mark_m: The last metre begins at this range. From there obstacles in view are beside the
            mark or behind it.
        look_down_m: The camera looks down at obstacles of unknown range if the mark is nearer.
        clear_m: Least distance of obstacles from the straight path in the last metre. The approach
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
    """Return the map's mark, unless a search at its place has failed since the last sighting.

    Args:
        leaf: A leaf that declares `TRACK_KEYS`.
    """
    site_map, gone_s = leaf.read(SITE_MAP).value, leaf.read(MARK_GONE).value
    mark = None if site_map is None else site_map.mark
    return mark if mark is not None and (gone_s is None or mark.seen_s > gone_s) else None


def believed_fix(leaf: Leaf) -> MarkFix | None:
    """Return the track if it is not lost and its place is plausible; else None.

    A plausible place is near the map's mark. Without a mark on the map, it is anywhere but beyond
    the edge of the ground: a mask may mistake something far behind that edge for the mark.

    Args:
        leaf: A leaf that declares `TRACK_KEYS`.
    """
    fix, site_map = leaf.read(MARK).value, leaf.read(SITE_MAP).value
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


def is_clear(leaf: Leaf, fix: MarkFix) -> bool:
    """Return whether no seen obstacle is on the straight path to the mark.

    Args:
        leaf: A leaf that declares `TRACK_KEYS`.
        fix: The track.
    """
    reading = leaf.read(SITE_MAP)
    if reading.value is None:  # a tree may lack a map; a stale map permits nothing
        return math.isinf(reading.age_s)
    near = reading.value.near
    return near.allows(fix.forward_m, fix.right_m, margin_m=TRACK.clear_m, assumed=False)


def is_at_mark(fix: MarkFix, now_s: float, close_m: float = TRACK.close_m) -> bool:
    """Return whether the last metre begins: the mark is near, or left the view by the lower edge.

    Args:
        fix: The track.
        now_s: Time of the mission clock.
        close_m: A mark out of view and nearer than this has left the view by the lower edge.
    """
    unseen = not fix.detected and now_s - fix.captured_s > TRACK.out_of_view_s
    below = unseen and abs(fix.bearing_rad) < TRACK.ahead_rad
    return fix.range_m <= TRACK.at_mark_m or (below and fix.range_m < close_m)


def straight_to(fix: MarkFix, *, most_m: float = math.inf) -> FollowLeg | Rotate:
    """Return the straight course to the mark.

    Args:
        fix: The track.
        most_m: Distance up to which the path ahead is free.
    """
    reason = f"mark {fix.range_m:.1f} m"
    speed_mps = min(TRACK.fast_mps, TRACK.slow_down_per_s * min(fix.range_m, most_m))
    if abs(fix.bearing_rad) >= TRACK.ahead_rad or speed_mps <= 0.0:
        return Rotate(yaw_rad=fix.bearing_rad, reason=reason)
    return FollowLeg(yaw_rad=fix.bearing_rad, speed_mps=speed_mps, reason=reason)
