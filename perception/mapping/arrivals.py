"""Which points of a view stand, and which have arrived on ground that was seen free before."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.mapping.ground_grid import GroundGrid
from perception.mapping.landmarks import Landmarks
from perception.mapping.movers import MoverTracker
from uav_bt.types import CameraModel, Frame
from uav_bt.types.projection import project

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_CUT: Final = 0.025  # of the image's width: so near to its ends a thing goes on beyond it


@dataclass(frozen=True, kw_only=True)
class ArrivalConfig:
    """What counts as more of what stands.

    A point that is seen again is off by the map's drift and by the errors of height and pitch. Near
    a point that has stood for long that explains a new one; a thing that stood for a moment when it
    came into view may move.
    """

    beside_m: float = 0.3  # as near to a point that has stood for long,
    beside_new_m: float = 0.12  # to a new one,
    beside_mps: float = 0.09  # and so much more for each second in between
    settles_s: float = 2.0  # a point on ground that was seen before counts only after so long
    shared_m: float = 0.2  # what is of a mover may be so much nearer


def standing(
    seen: Landmarks,
    known: Landmarks,
    grid: GroundGrid,
    movers: MoverTracker,
    *,
    cut: Flags,
    is_low: bool,
    config: ArrivalConfig,
) -> Landmarks:
    """Return the points of a view that stand; those that have arrived are followed.

    Args:
        seen: of the view, N points.
        known: the map's.
        grid: of the ground, as it was before the view.
        movers: what is followed.
        cut: (N,) which points lie where the view ends.
        is_low: whether it was seen from too far down to tell what moves.
        config: what counts as more of what stands.
    """
    if not len(seen):
        return seen
    time_s, places_m = float(seen.seen_s[0]), seen.xy_m
    on_ground = grid.was_ground(places_m)
    off_m = _off_standing_m(places_m, known, time_s, config)
    owned = movers.owns(places_m, time_s) & (off_m > -config.shared_m)
    arrived = (on_ground & (off_m > 0.0)) | owned
    stands = ~arrived
    stands[arrived] = movers.see(
        places_m[arrived], seen.from_m[0], time_s, cut=cut[arrived], judges=not is_low
    )
    seen.settled_s[on_ground] += config.settles_s
    return seen.take(stands)


def _off_standing_m(
    places_m: Floats, known: Landmarks, time_s: float, config: ArrivalConfig
) -> Floats:
    """Return how far places are from the circles around what is known to stand."""
    known = known.take((known.settled_s <= time_s) & (known.missed == 0.0))
    if not len(known):
        return np.full(len(places_m), math.inf)
    reach_m = config.beside_new_m + config.beside_mps * (time_s - known.settled_s)
    apart_m = np.hypot(*np.moveaxis(places_m[:, None] - known.xy_m, -1, 0))
    return np.asarray((apart_m - np.minimum(config.beside_m, reach_m)).min(axis=1))


def is_cut(points_m: Floats, frame: Frame, camera: CameraModel) -> Flags:
    """Return which points on the ground lie where the image ends to the left and right.

    Args:
        points_m: (N, 2) forward, right of the point below the camera.
        frame: its pitch and height.
        camera: intrinsics at the class map's size.
    """
    height_m = np.full((len(points_m), 1), frame.height_above_carpet_m)
    columns = project(np.hstack([points_m, height_m]), camera, frame.gimbal_pitch_rad)[:, 0]
    margin_px = _CUT * camera.width_px
    return np.asarray((columns < margin_px) | (columns > camera.width_px - margin_px))
