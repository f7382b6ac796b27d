"""The safety corridor: five planes around the path ahead, and the obstacles between them.

The paper (Mocanu et al.) writes X up, Y lateral, Z forward, in a frame at the drone's centre. Here
this frame is level, x forward, y right, z down, so that X = -z, Y = y, Z = x. The "camera position
P'" in the text of equation 8 is T (C with the offset of equation 11); P' is the pixel on the image
plane. With r a pixel's ray of unit depth and C the lens, ahead of the centre by its offset:

    P'        = C + a * r                     (6)   a: distance of the image plane
    P'_center = C + (P' - C) * f             (12)   f: the focal factor
    P''       = C + lambda * (P'_center - C)  (8)   a point on the ray
    lambda    = (plane - C) / (P'_center - C)  (10A-10E, in the plane's own coordinate)

A plane counts if lambda > 1: it lies beyond the image plane. A point at depth d of a pixel is
C + d * r, so the ray crosses a plane at the depth ``lambda * a * f``. This depth is compared with
the depth of the pixel; both are along the optical axis. (Along the ray both grow by the same
factor. Mixing depth and range would miss obstacles at the image's edge.) Each ray leaves the
corridor through the nearest plane. A pixel with less depth is inside the corridor and counts for
the side of that plane.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import CameraView, level_rays
from uav_bt.compiled import compiled
from uav_bt.types import Airframe, BodyVelocity, Corridor, DepthMap
from uav_bt.types.arrays import Flags, Floats32, Indices

SIDES: Final = ("left", "right", "front", "up", "down")

# a: planes nearer to the lens than f times this do not count. The paper's normalised rays put the
# image plane at 1 m. All pixels more than 27 degrees off the axis then lose their side planes,
# which widens the corridor there. This value is that of a real lens.
_IMAGE_PLANE_M: Final = 0.02
# Depth at object borders mixes near and far: this number of nearest pixels is ignored.
_STRAY_PX: Final = 4
_STANDING_MPS: Final = 0.05  # below this speed the time to impact is infinite


@dataclass(frozen=True, kw_only=True)
class CorridorConfig:
    """Distances from the drone's centre; by default the paper's."""

    side_m: float = 0.5  # twice the body's half width and a margin
    front_m: float = 2.0  # half the width of the paper's carpet
    up_down_m: float = 0.8  # at a flight height of 1.5 m the ground and the mark stay below
    focal_factor: float = 1.0  # f; 0.8 to 1.2 in the paper
    nose_m: float = Airframe().body_size_m[0] / 2  # the body's front ahead of its centre

    @property
    def least_plane_m(self) -> float:
        """Planes at this depth or nearer do not count, m."""
        return self.focal_factor * _IMAGE_PLANE_M


# Of a camera and attitude: every pixel's ray, (3, H, W) of unit depth forward, right, down; (H, W)
# depth at which it leaves the corridor, inf if it meets no plane; (H, W) index into SIDES of that.
_Planes = tuple[Floats32, Floats32, NDArray[np.uint8]]


class CorridorBuilder:
    """Builds corridors, and keeps the planes of the last attitudes."""

    def __init__(self, config: CorridorConfig | None = None) -> None:
        self._config = config or CorridorConfig()
        self._planes = lru_cache(maxsize=8)(partial(_planes_of, self._config))

    def build(
        self,
        depth: DepthMap,
        view: CameraView,
        *,
        velocity: BodyVelocity | None = None,
        things: Flags | None = None,
    ) -> Corridor:
        """Find the obstacles inside the corridor.

        A pixel with unknown depth is inside if its upper bound is inside. Its range is unknown, so
        the free distance is then 0.

        Args:
            depth: metric depth, (H, W).
            view: the camera, at that size.
            velocity: of the body, for the time to impact; None for a hovering drone.
            things: (H, W) pixels that count; None for all. Pixels of unknown depth count only if
                this mask is given.
        """
        side, (found, range_m, right_m, ahead_m, unseen, unknown) = self._seen(depth, view, things)
        nearest = _nearest(range_m)
        free_m = 0.0 if unseen > _STRAY_PX else _nearest_m(ahead_m)
        speed_mps = 0.0 if velocity is None else velocity.forward_mps
        impact_s = math.inf
        if speed_mps > _STANDING_MPS and math.isfinite(free_m):
            impact_s = max(0.0, free_m - self._config.nose_m) / speed_mps
        return Corridor(
            captured_s=depth.captured_s,
            free_distance_m=free_m,
            nearest_m=math.inf if nearest is None else float(range_m[nearest]),
            nearest_side=None if nearest is None else SIDES[side.ravel()[found[nearest]]],
            time_to_impact_s=impact_s,
            nearest_left_m=_nearest_m(range_m[right_m < 0.0]),
            nearest_right_m=_nearest_m(range_m[right_m >= 0.0]),
            unknown_px=unknown,
        )

    def intruding(self, depth: DepthMap, view: CameraView, *, things: Flags | None = None) -> Flags:
        """Return the pixels, (H, W), that `build` finds inside the corridor, for images."""
        intruding = np.zeros(depth.depth.shape, dtype=bool)
        intruding.ravel()[self._seen(depth, view, things)[1][0]] = True
        return intruding

    def _seen(
        self, depth: DepthMap, view: CameraView, things: Flags | None
    ) -> tuple[NDArray[np.uint8], _Seen]:
        """Return the plane through which each ray leaves, and what `_intrusions` finds."""
        rays, exits_m, side = self._planes(
            replace(view, height_m=0.0)
        )  # planes do not depend on the height
        metres = np.ascontiguousarray(depth.depth, dtype=np.float32).ravel()
        bounds = metres
        if depth.at_most is not None:
            bounds = np.ascontiguousarray(depth.at_most, dtype=np.float32).ravel()
        counts = np.isfinite(metres) if things is None else np.ascontiguousarray(things).ravel()
        side_m, up_down_m = self._config.side_m, self._config.up_down_m
        walls_m = np.array([side_m, up_down_m, view.camera.forward_offset_m], dtype=np.float32)
        rays, exits_m = rays.reshape(3, -1), exits_m.ravel()
        return side, _intrusions(metres, bounds, counts, rays, exits_m, walls_m)


def _planes_of(config: CorridorConfig, view: CameraView) -> _Planes:
    """Intersect every ray with the five planes (equations 10A to 10E, 11 and 12)."""
    rays = level_rays(view)
    ahead_m = config.front_m - view.camera.forward_offset_m  # C: the lens ahead of the centre
    distances_m = (config.side_m, config.side_m, ahead_m, config.up_down_m, config.up_down_m)
    least_m = np.float32(config.least_plane_m)
    return rays, *_exits(rays, np.array(distances_m, dtype=np.float32), least_m)


def _nearest(distances: Floats32) -> int | None:
    """Return the index of the nearest distance that is not a stray; None without one."""
    if distances.size <= _STRAY_PX:
        return None
    return int(np.argpartition(distances, _STRAY_PX)[_STRAY_PX])


def _nearest_m(distances: Floats32) -> float:
    place = _nearest(distances)
    return math.inf if place is None else float(distances[place])


_Seen = tuple[Indices, Floats32, Floats32, Floats32, int, int]


@compiled("Tuple((float32[:, ::1], uint8[:, ::1]))(float32[:, :, ::1], float32[::1], float32)")
def _exits(
    rays: Floats32, distances_m: Floats32, least_m: np.float32
) -> tuple[Floats32, NDArray[np.uint8]]:
    """Find the nearest plane that each ray crosses.

    Args:
        rays: (3, H, W) rays of unit depth: forward, right, down.
        distances_m: (5,) distances of the planes from the lens, in the order of SIDES.
        least_m: planes at this depth or nearer do not count.

    Returns:
        (H, W) depth of the crossing, inf without one; (H, W) index into SIDES.
    """
    shape = rays.shape[1:]
    depth_m, side = np.full(shape, np.float32(np.inf)), np.zeros(shape, dtype=np.uint8)
    for row in range(shape[0]):
        for column in range(shape[1]):
            for index in range(5):
                axis = 1 if index < 2 else 0 if index == 2 else 2
                towards = rays[axis, row, column]
                towards = -towards if index in (0, 3) else towards
                if towards > np.float32(1e-6):
                    crossed_m = distances_m[index] / towards
                    if least_m < crossed_m < depth_m[row, column]:
                        depth_m[row, column], side[row, column] = crossed_m, index
    return depth_m, side


@compiled(
    "Tuple((intp[::1], float32[::1], float32[::1], float32[::1], int64, int64))"
    "(Array(float32, 1, 'C', readonly=True), Array(float32, 1, 'C', readonly=True),"
    " Array(boolean, 1, 'C', readonly=True), float32[:, ::1], float32[::1], float32[::1])"
)
def _intrusions(  # noqa: PLR0917 - Numba passes arguments by position
    depth_m: Floats32,
    bounds_m: Floats32,
    counts: Flags,
    rays: Floats32,
    exits_m: Floats32,
    walls_m: Floats32,
) -> _Seen:
    """Find the pixels inside the corridor, and those ahead of the centre between its walls.

    Args:
        depth_m: (P,) depth of each pixel, not finite where unknown.
        bounds_m: (P,) upper bounds of the depth.
        counts: (P,) pixels that count.
        rays: (3, P) rays of unit depth: forward, right, down.
        exits_m: (P,) depth at which the rays leave the corridor.
        walls_m: (3,) side walls, upper and lower wall from the centre, and the lens ahead of it.

    Returns:
        (N,) pixels inside; (N,) their range from the centre; (N,) their position to the right;
        (K,) distance ahead of the pixels between the walls; the number of pixels inside whose depth
        is unknown; the number of pixels whose depth is unknown.
    """
    side_m, up_down_m, offset_m = walls_m
    found = np.empty(len(depth_m), dtype=np.intp)
    ranges_m, across_m = np.empty_like(depth_m), np.empty_like(depth_m)
    ahead_m = np.empty_like(depth_m)
    inside, ahead, unseen, unknown = 0, 0, 0, 0
    for pixel in range(len(depth_m)):
        if not counts[pixel]:
            continue
        forward, right, down = rays[0, pixel], rays[1, pixel], rays[2, pixel]
        metres, bound = depth_m[pixel], bounds_m[pixel]
        is_known = np.isfinite(metres)
        if is_known:
            bound = metres if not bound < metres else bound
            x, y, z = metres * forward + offset_m, metres * right, metres * down
            if x > 0.0 and abs(y) <= side_m and abs(z) <= up_down_m:
                ahead_m[ahead] = x
                ahead += 1
        else:
            unknown += 1
        if (metres if is_known else bound) < exits_m[pixel]:
            unseen += not is_known
            x, y, z = bound * forward + offset_m, bound * right, bound * down
            found[inside], across_m[inside] = pixel, y
            ranges_m[inside] = np.sqrt(x * x + y * y + z * z)
            inside += 1
    return found[:inside], ranges_m[:inside], across_m[:inside], ahead_m[:ahead], unseen, unknown
