"""Ways out: straight escapes from a mover that approaches the drone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from behaviours.path.clearance import ClearanceMap
from behaviours.path.movers_ahead import MoversAheadConfig, gap_m
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.site_map import MapMover, SiteMap

_AROUND_M: Final = 0.15  # m around a mover's circle: error of its points


@dataclass(frozen=True, kw_only=True)
class WayOutConfig:
    """Parameters of the search. The numbers were chosen in flights among movers in the twin.

    Attributes:
        moving: How movers are predicted.
        directions: Number of directions that are tried.
        speeds_mps: Speeds that are tried.
        reaction_s: Time from a decision to its effect.
        furthest_m: Length of the longest way.
        brake_mps2: Deceleration that the drone can rely on.
        enough_m: Gaps wider than this count as equal.
        per_m: Least gain in gap per metre flown.
        kept_m: Bonus in gap for the present direction.
        stop_s: The drone is predicted to keep its velocity for this time and then stand still.
    """

    moving: MoversAheadConfig = field(default_factory=MoversAheadConfig)
    directions: int = 24
    speeds_mps: tuple[float, ...] = (0.3, 0.6)
    reaction_s: float = 0.4
    furthest_m: float = 1.2
    brake_mps2: float = 0.8
    enough_m: float = 0.5
    per_m: float = 0.08
    kept_m: float = 0.1
    stop_s: float = 1.0


@dataclass(frozen=True, kw_only=True)
class WayOut:
    """The velocity of a straight way out, in the map's frame; 0 to stay.

    Attributes:
        x_mps: Velocity along the map's x axis.
        y_mps: Velocity along the map's y axis.
    """

    x_mps: float = 0.0
    y_mps: float = 0.0


def is_threatened(site_map: SiteMap, config: WayOutConfig) -> bool:
    """Return whether a mover comes too near to a drone that stays where it is."""
    pose, moving = site_map.pose, config.moving
    here_m = np.broadcast_to((pose.x_m, pose.y_m), (len(moving.times_s), 2))
    return bool(gap_m(site_map.movers, here_m, moving) < moving.spare_m)


def runs_into(site_map: SiteMap, velocity_mps: Floats, config: WayOutConfig) -> bool:
    """Return whether a drone that flies on for a moment comes too near to a mover.

    Args:
        site_map: The map with its movers.
        velocity_mps: (2,) velocity of the drone over the ground, in the map's frame.
        config: How movers are predicted.
    """
    pose, moving = site_map.pose, config.moving
    flown_s = np.minimum(moving.times_s, config.stop_s)[:, None]
    places_m = np.array([pose.x_m, pose.y_m]) + flown_s * velocity_mps
    return bool(gap_m(site_map.movers, places_m, moving) < moving.spare_m)


def standing_alone(site_map: SiteMap) -> SiteMap:
    """Return the map without its movers and their lanes."""
    return replace(site_map, movers=(), lanes_m=np.empty((0, 2)))


def is_of_movers(movers: Sequence[MapMover], points_m: Floats) -> Flags:
    """Return which points belong to movers.

    Args:
        movers: The movers of the map.
        points_m: (N, 2) in the map's frame.
    """
    found = np.zeros(len(points_m), dtype=bool)
    for mover in movers:
        apart_m = np.hypot(*(points_m - (mover.x_m, mover.y_m)).T)
        found |= apart_m <= mover.radius_m + _AROUND_M
    return found


def way_out(
    clearance: ClearanceMap,
    movers: Sequence[MapMover],
    config: WayOutConfig,
    *,
    before: WayOut | None = None,
) -> WayOut:
    """Return the velocity that leaves the widest gap to movers; 0 to stay.

    The way leads over ground that was seen, with clearance. The drone can stop before it ends.

    Args:
        clearance: The clearance map of the standing obstacles.
        movers: The movers.
        config: Parameters of the search.
        before: The way that is being flown; None without one.
    """
    pose, times_s = clearance.map.pose, config.moving.times_s
    here_m = np.array([pose.x_m, pose.y_m])
    azimuths = np.arange(config.directions) * 2.0 * math.pi / config.directions
    headings = np.stack([np.cos(azimuths), np.sin(azimuths)], axis=-1)
    reaches_m = _open_m(clearance, here_m, headings, config.furthest_m)
    speeds_mps = np.array(config.speeds_mps)
    flown_m = speeds_mps[:, None] * np.maximum(times_s - config.reaction_s, 0.0)
    stops_m = speeds_mps * config.reaction_s + speeds_mps**2 / (2.0 * config.brake_mps2)
    reaches_m = np.maximum(reaches_m[:, None] - stops_m, 0.0)  # (directions, speeds)
    flown_m = np.minimum(flown_m, reaches_m[..., None])  # (directions, speeds, T)
    places_m = here_m + flown_m[..., None] * headings[:, None, None]
    left_m = gap_m(movers, places_m, config.moving)
    worth = np.minimum(left_m, config.enough_m) - config.per_m * flown_m[..., -1]
    if before is not None and math.hypot(before.x_mps, before.y_mps) > 0.0:
        worth += config.kept_m * np.cos(azimuths - math.atan2(before.y_mps, before.x_mps))[:, None]
    worth[reaches_m <= 0.0] = -np.inf
    stays = np.broadcast_to(here_m, (len(times_s), 2))
    stays_m = float(gap_m(movers, stays, config.moving))
    direction, speed = np.unravel_index(int(worth.argmax()), worth.shape)
    if worth[direction, speed] <= min(stays_m, config.enough_m):
        return WayOut()
    x_mps, y_mps = map(float, speeds_mps[speed] * headings[direction])
    return WayOut(x_mps=x_mps, y_mps=y_mps)


def _open_m(clearance: ClearanceMap, here_m: Floats, headings: Floats, furthest_m: float) -> Floats:
    """Return the open distance along each heading, metres, (D,)."""
    found = clearance.map
    ranges_m = np.arange(found.cell_m, furthest_m + found.cell_m / 2, found.cell_m)
    places_m = here_m + ranges_m[:, None] * headings[:, None]
    cells = np.floor((places_m - found.corner_m) / found.cell_m + 0.5).astype(int)
    inside = np.asarray(((cells >= 0) & (cells < found.free.shape)).all(axis=-1))
    rows, columns = np.moveaxis(np.where(np.expand_dims(inside, -1), cells, 0), -1, 0)
    # The map also counts the cells around the drone as free. A drone that evades again and again
    # carries them along, beyond an edge that it has not seen.
    is_flyable = np.logical_and(clearance.open, found.ground)
    is_open = np.logical_and(inside, is_flyable[rows, columns])
    return np.asarray(found.cell_m * np.logical_and.accumulate(is_open, axis=1).sum(axis=1))
