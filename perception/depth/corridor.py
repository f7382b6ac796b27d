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

import functools
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import CameraView, level_rays
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.types import Airframe, BodyVelocity, Corridor, DepthMap

if TYPE_CHECKING:
    from perception.depth.corridor_loops import Seen

Side = Literal["left", "right", "front", "up", "down"]
SIDES: Final[tuple[Side, ...]] = ("left", "right", "front", "up", "down")


@dataclass(frozen=True, kw_only=True)
class CorridorConfig:
    """Distances from the drone's centre; by default the paper's."""

    left_m: float = 0.5  # twice the body's half width and a margin
    right_m: float = 0.5  # as left_m
    front_m: float = 2.0  # half the width of the paper's carpet
    up_m: float = 0.8
    down_m: float = 0.8  # at a flight height of 1.5 m the ground and the mark stay below
    focal_factor: float = 1.0  # f; 0.8 to 1.2 in the paper
    # a: planes nearer to the lens than f times this do not count. The paper's normalised rays put
    # the image plane at 1 m. All pixels more than 27 degrees off the axis then lose their side
    # planes, which widens the corridor there. This value is that of a real lens.
    image_plane_m: float = 0.02
    nose_m: float = Airframe().body_size_m[0] / 2  # the body's front ahead of its centre
    # Depth at object borders mixes near and far: this number of nearest pixels is ignored.
    stray_px: int = 4
    standing_mps: float = 0.05  # below this speed the time to impact is infinite

    def __post_init__(self) -> None:
        distances = (self.left_m, self.right_m, self.front_m, self.up_m, self.down_m)
        lengths = (*distances, self.focal_factor, self.image_plane_m)
        if not all(math.isfinite(value) and value > 0.0 for value in lengths):
            raise ValueRangeError(
                "the corridor's distances, focal factor and image plane must be positive and "
                f"finite, got {self}"
            )
        if self.stray_px < 0:
            raise ValueRangeError(f"stray_px must not be negative, got {self.stray_px}")


@dataclass(frozen=True, kw_only=True)
class CorridorPlanes:
    """Exit of every pixel's ray from the corridor; depends on camera and attitude only."""

    rays: NDArray[np.float32]  # (3, H, W) of unit depth: forward, right, down
    depth_m: NDArray[np.float32]  # (H, W) along the optical axis; inf if the ray meets no plane
    side: NDArray[np.uint8]  # (H, W) index into SIDES of the exit plane; undefined at inf

    @classmethod
    def of(cls, view: CameraView, config: CorridorConfig) -> CorridorPlanes:
        """Intersect every ray with the five planes (equations 10A to 10E, 11 and 12)."""
        from perception.depth.corridor_loops import exits  # noqa: PLC0415 - late: Numba takes long to import

        rays = level_rays(view)
        ahead_m = config.front_m - view.camera.forward_offset_m  # C: the lens ahead of the centre
        distances_m = (config.left_m, config.right_m, ahead_m, config.up_m, config.down_m)
        depth_m, side = exits(
            rays,
            np.array(distances_m, dtype=np.float32),
            np.float32(config.focal_factor * config.image_plane_m),
        )
        return cls(rays=rays, depth_m=depth_m, side=side)


def build_corridor(
    depth: DepthMap,
    planes: CorridorPlanes,
    *,
    offset_m: float,
    velocity: BodyVelocity | None = None,
    things: NDArray[np.bool_] | None = None,
    config: CorridorConfig | None = None,
) -> Corridor:
    """Find the obstacles inside the corridor.

    A pixel with unknown depth is inside if its upper bound is inside. Its range is unknown, so the
    free distance is then 0.

    Args:
        depth: metric depth, (H, W).
        planes: planes of the same camera and attitude.
        offset_m: distance of the lens ahead of the body's centre (C).
        velocity: of the body, for the time to impact; None for a hovering drone.
        things: (H, W) bool, pixels that count; None for all. Pixels of unknown depth count only if
            this mask is given.
        config: the corridor of the planes.

    Raises:
        ShapeError: the sizes differ.
        ValueRangeError: the depth is not metric.
    """
    config = config or CorridorConfig()
    _check(depth, planes, things)
    found, range_m, right_m, ahead_m, unseen, unknown = _seen_inside(
        depth, planes, things, offset_m, config
    )
    nearest = _nearest(range_m, config.stray_px)
    free_m = 0.0 if unseen > config.stray_px else _nearest_m(ahead_m, config.stray_px)
    return Corridor(
        captured_s=depth.captured_s,
        free_distance_m=free_m,
        nearest_m=math.inf if nearest is None else float(range_m[nearest]),
        nearest_side=None if nearest is None else SIDES[planes.side.ravel()[found[nearest]]],
        time_to_impact_s=_impact(free_m, velocity, config),
        nearest_left_m=_nearest_m(range_m[right_m < 0.0], config.stray_px),
        nearest_right_m=_nearest_m(range_m[right_m >= 0.0], config.stray_px),
        unknown_px=unknown,
    )


def _seen_inside(
    depth: DepthMap,
    planes: CorridorPlanes,
    things: NDArray[np.bool_] | None,
    offset_m: float,
    config: CorridorConfig,
) -> Seen:
    """Return what `intrusions` finds in a depth map."""
    from perception.depth.corridor_loops import intrusions  # noqa: PLC0415 - late: Numba takes long to import

    metres = np.ascontiguousarray(depth.depth, dtype=np.float32).ravel()
    bounds = (
        metres
        if depth.at_most is None
        else np.ascontiguousarray(depth.at_most, dtype=np.float32).ravel()
    )
    counts = np.isfinite(metres) if things is None else np.ascontiguousarray(things).ravel()
    walls_m = -config.left_m, config.right_m, -config.up_m, config.down_m, offset_m
    rays, exits_m = planes.rays.reshape(3, -1), planes.depth_m.ravel()
    return intrusions(metres, bounds, counts, rays, exits_m, np.array(walls_m, dtype=np.float32))


def _check(depth: DepthMap, planes: CorridorPlanes, things: NDArray[np.bool_] | None) -> None:
    if not depth.metric:
        raise ValueRangeError("the corridor needs depth in metres; scale the relative depth first")
    height, width = planes.depth_m.shape
    for name, shape in (
        ("depth map", depth.depth.shape),
        ("mask of things", (height, width) if things is None else things.shape),
    ):
        if shape != (height, width):
            raise ShapeError(name, expected=f"{height}x{width}, as the planes", actual=shape)


def _nearest(distances: NDArray[np.float32], stray_px: int) -> int | None:
    """Return the index of the nearest distance that is not a stray; None without one."""
    if distances.size <= stray_px:
        return None
    return int(np.argpartition(distances, stray_px)[stray_px])


def _nearest_m(distances: NDArray[np.float32], stray_px: int) -> float:
    place = _nearest(distances, stray_px)
    return math.inf if place is None else float(distances[place])


def _impact(free_m: float, velocity: BodyVelocity | None, config: CorridorConfig) -> float:
    speed_mps = 0.0 if velocity is None else velocity.forward_mps
    if not speed_mps > config.standing_mps or math.isinf(free_m):
        return math.inf
    return max(0.0, free_m - config.nose_m) / speed_mps


class CorridorBuilder:
    """Builds corridors, and caches the planes of the last attitudes.

    Args:
        config: the corridor.
    """

    def __init__(self, config: CorridorConfig | None = None) -> None:
        from perception.depth import corridor_loops  # noqa: F401, PLC0415 - compiled before the flight

        self._config = config or CorridorConfig()
        self._planes = functools.lru_cache(maxsize=8)(
            functools.partial(CorridorPlanes.of, config=self._config)
        )

    def planes(self, view: CameraView) -> CorridorPlanes:
        """Return the planes of a view, computed once for each camera and attitude."""
        return self._planes(replace(view, height_m=0.0))  # planes do not depend on the height

    def intruding(
        self, depth: DepthMap, view: CameraView, *, things: NDArray[np.bool_] | None = None
    ) -> NDArray[np.bool_]:
        """Return the pixels that `build` finds inside the corridor, for images.

        Args:
            depth: metric depth, (H, W).
            view: the camera, at that size.
            things: (H, W) pixels that count; all when None.

        Returns:
            (H, W) bool.

        Raises:
            ShapeError: the sizes differ.
            ValueRangeError: the depth is not metric.
        """
        planes = self.planes(view)
        _check(depth, planes, things)
        found = _seen_inside(depth, planes, things, view.camera.forward_offset_m, self._config)[0]
        intruding = np.zeros(depth.depth.shape, dtype=bool)
        intruding.ravel()[found] = True
        return intruding

    def build(
        self,
        depth: DepthMap,
        view: CameraView,
        *,
        velocity: BodyVelocity | None = None,
        things: NDArray[np.bool_] | None = None,
    ) -> Corridor:
        """Find the obstacles inside the corridor; see `build_corridor`."""
        return build_corridor(
            depth,
            self.planes(view),
            offset_m=view.camera.forward_offset_m,
            velocity=velocity,
            things=things,
            config=self._config,
        )
