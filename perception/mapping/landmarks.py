"""The map's points: where obstacles meet the ground, and where the ground ends.

A point stays where the first views placed it, so that what is seen again can correct the drone's
place instead of following its drift. It goes when the ground around it is seen free.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from perception.obstacles.contact_scan import Bases
from uav_bt.classes import GROUP_CARPET
from uav_bt.types import CameraModel, Frame, Pose2D
from uav_bt.types.projection import project

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class LandmarkConfig:
    """Which points are kept, and when they go."""

    same_m: float = 0.08  # what is seen so near to a known point is that point
    # A pixel of a base weighs too much further away, and the more the lower the camera is: it errs
    # by the square of the range over the height.
    max_range_m: float = 3.0
    max_range_ratio: float = 2.0  # of the height
    # The weight of a sighting falls with the square of its range. A point that so many have placed,
    # counted from a metre away, stays: it would follow the drift that it shall correct.
    enough: float = 3.0
    # A base is one of a row of them: on the bearing of a vertical edge, samples that miss it below
    # and hit it above look like a base far behind.
    beside_rad: float = 0.03
    beside_m: float = 0.12
    # A point goes when the ground is seen at it and at this distance to all four sides, in more
    # views than placed it: a pose that is off for a moment must not wipe out what would correct it.
    probe_m: float = 0.05
    min_missed: float = 3.0
    max_missed: float = 10.0
    min_pitch_rad: float = -1.0  # looking further down, roofs are nearer than bases

    def reach_m(self, height_m: float) -> float:
        """Return from how far points are taken by a camera so high above the ground."""
        return min(self.max_range_m, self.max_range_ratio * height_m)


@dataclass
class Landmarks:
    """Points of one kind, as columns of a table."""

    xy_m: Floats  # (N, 2) in the map's frame
    weight: Floats  # (N,) of the sightings that placed it
    first_s: Floats  # (N,) first and last seen
    seen_s: Floats
    settled_s: Floats  # (N,) from then on what is seen beside it stands, too
    from_m: Floats  # (N, 2) where the camera was when it was placed
    ids: NDArray[np.uint8]  # (N,) class that stands there
    missed: Floats  # (N,) views that showed nothing but ground there, since it was last seen

    @classmethod
    def none(cls) -> Landmarks:
        """Return an empty table."""
        return cls(
            xy_m=np.empty((0, 2)),
            weight=np.empty(0),
            first_s=np.empty(0),
            seen_s=np.empty(0),
            settled_s=np.empty(0),
            from_m=np.empty((0, 2)),
            ids=np.empty(0, dtype=np.uint8),
            missed=np.empty(0),
        )

    def __len__(self) -> int:
        return len(self.xy_m)

    def take(self, which: NDArray[np.bool_] | NDArray[np.intp]) -> Landmarks:
        """Return the chosen rows."""
        return Landmarks(**{name: column[which] for name, column in vars(self).items()})

    def with_rows(self, other: Landmarks) -> Landmarks:
        """Return this table with another's rows below."""
        mine, theirs = vars(self), vars(other)
        return Landmarks(**{name: np.concatenate([mine[name], theirs[name]]) for name in mine})


def seen_points(
    points_m: Floats,
    ids: NDArray[np.uint8],
    lens: Pose2D,
    captured_s: float,
) -> Landmarks:
    """Return what one view shows as a table.

    Args:
        points_m: (N, 2) forward, right of the point below the camera.
        ids: (N,) classes.
        lens: where the camera was, in the map's frame.
        captured_s: when.
    """
    count = len(points_m)
    return Landmarks(
        xy_m=lens.points_to_world(points_m),
        weight=1.0 / np.maximum((points_m**2).sum(axis=1), 0.25),
        first_s=np.full(count, captured_s),
        seen_s=np.full(count, captured_s),
        settled_s=np.full(count, captured_s),
        from_m=np.tile([lens.x_m, lens.y_m], (count, 1)),
        ids=ids,
        missed=np.zeros(count),
    )


def merged(
    known: Landmarks, seen: Landmarks, config: LandmarkConfig, *, adds: bool = True
) -> Landmarks:
    """Return the known points with those of a view.

    What stands near a known point is that point again, which moves to the weighted mean of its
    sightings; the rest is new.

    Args:
        known: the map's points.
        seen: of the view.
        config: how near is near.
        adds: False leaves out what is new.
    """
    seen = _thinned(seen, config)
    if not len(known) or not len(seen):
        return known.with_rows(seen) if adds else known
    apart_m, nearest = cKDTree(known.xy_m).query(seen.xy_m)
    again = apart_m <= config.same_m
    result = known.with_rows(seen.take(~again & adds))
    rows, sighted = nearest[again], seen.take(again)
    moves = result.weight[rows] < config.enough
    share = moves * sighted.weight / (sighted.weight + result.weight[rows])
    result.xy_m[rows] += share[:, None] * (sighted.xy_m - result.xy_m[rows])
    result.weight[rows] += sighted.weight
    result.seen_s[rows] = sighted.seen_s
    result.missed[rows] = 0.0
    return result


def _thinned(points: Landmarks, config: LandmarkConfig) -> Landmarks:
    """Return one point of each cell."""
    cells = np.floor(points.xy_m / config.same_m).astype(np.int64)
    _, first = np.unique((cells[:, 0] << 32) + cells[:, 1], return_index=True)
    return points.take(first)


def shown_free(
    known: Landmarks,
    groups: NDArray[np.uint8],
    lens: Pose2D,
    frame: Frame,
    camera: CameraModel,
    *,
    config: LandmarkConfig,
) -> tuple[Flags, Flags]:
    """Return which of the known points lie in a view, and around which of them it shows ground.

    Args:
        known: the map's points, N of them.
        groups: (H, W) group ids of the view.
        lens: where the camera was, in the map's frame.
        frame: its pitch and height.
        camera: intrinsics at the size of `groups`.
        config: how far around.

    Returns:
        (N,) whether a point is near enough and not hidden by the image's border, and (N,) whether
        there is nothing but ground around it.
    """
    local = lens.points_to_body(known.xy_m)
    probe = config.probe_m * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
    places = local[:, None, :] + probe
    height_m = np.full((*places.shape[:2], 1), max(frame.height_above_carpet_m, 0.05))
    pixels = project(np.concatenate([places, height_m], axis=-1), camera, frame.gimbal_pitch_rad)
    height_px, width_px = groups.shape
    columns, rows = pixels[..., 0], pixels[..., 1]
    with np.errstate(invalid="ignore"):
        inside = (columns >= 0) & (columns <= width_px - 1) & (rows >= 0) & (rows <= height_px - 1)
    shows = np.zeros(inside.shape, dtype=bool)
    shows[inside] = (
        groups[np.rint(rows[inside]).astype(int), np.rint(columns[inside]).astype(int)]
        == GROUP_CARPET
    )
    near = np.hypot(*local.T) <= config.reach_m(frame.height_above_carpet_m)
    in_view: Flags = inside.all(axis=1) & near
    return in_view, np.asarray(shows.all(axis=1))


def without_missed(known: Landmarks, free: Flags, config: LandmarkConfig) -> Landmarks:
    """Return the known points less those that views have missed more often than is by chance.

    Args:
        known: the map's points, N of them.
        free: (N,) around which another view shows nothing but ground.
        config: how often is too often.
    """
    known.missed += free
    enough = np.clip(known.weight, config.min_missed, config.max_missed)
    return known.take(known.missed < enough)


class Sighting(NamedTuple):
    """The points that a view shows, from the point below the camera."""

    bases_m: Floats  # (N, 2) forward, right: where obstacles meet the ground
    ids: NDArray[np.uint8]  # (N,) classes of what stands there
    edges_m: Floats  # (M, 2): where the ground ends


def sighting(bases: Bases, height_m: float, config: LandmarkConfig) -> Sighting:
    """Return the points of a view that are near enough; of bases those with another beside them.

    Args:
        bases: of the view.
        height_m: of the camera above the ground.
        config: how near is near.
    """
    ranges_m, bearings = np.hypot(*bases.placed_m.T), np.arctan2(*bases.placed_m.T[::-1])
    alike = (np.abs(np.diff(bearings)) <= config.beside_rad) & (
        np.abs(np.diff(ranges_m)) <= config.beside_m
    )
    reach_m = config.reach_m(height_m)
    firm = np.zeros(len(ranges_m), dtype=bool)
    firm[1:] |= alike
    firm[:-1] |= alike
    firm &= ranges_m <= reach_m
    near = np.hypot(*bases.edges_m.T) <= reach_m
    return Sighting(bases.placed_m[firm], bases.placed_ids[firm], bases.edges_m[near])
