"""Class ids and depth of a view by ray casting: the output of a perfect network, without images.

Every pixel's ray is intersected with the ground, and with the boxes, cylinders and triangles whose
outlines in the image contain the pixel. The view is that of the twin's renderer at the same pose.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_bridge.anafi import anafi_camera
from sim_bridge.plain.rays import COLUMNS, cast_ground, cast_solids, cast_triangles, solid_row
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.shapes import Shape
from uav_bt.lab.classes import OUTSIDE
from uav_bt.types import MoverState, Pose2D

_FAR_M: Final = 30.0  # depth of the room beyond the ground, unless the room is larger

Bodies = tuple[NDArray[np.float64], tuple[NDArray[np.float64], NDArray[np.uint8]]]
"""The table of solids; corners of triangles, (N, 3, 3) world metres, and their class ids, (N,)."""


class Caster:
    """Casts the rays of one scene; a class map of any aspect gives the same view."""

    def __init__(self, scene: Scene, size_px: tuple[int, int]) -> None:
        self.size_px = size_px
        self.camera = camera = anafi_camera(640, 360).resized(*size_px)
        self._lens = np.array([camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px])
        u, v = np.meshgrid(np.arange(size_px[0]), np.arange(size_px[1]))
        right, down = (u - camera.cx_px) / camera.fx_px, (v - camera.cy_px) / camera.fy_px
        self.rays = np.stack([right, down], axis=-1)  # at unit depth
        self.classes = scene.classes
        self.ground_id = self.classes.ground
        ground = scene.ground
        edges = ground.area.edges[0] if ground.outline_m else ()
        self._ground = (
            np.array(ground.size_m) / 2,
            np.array(edges, dtype=np.float64).reshape(-1, 4),
            self.ground_id,
            max(_FAR_M, math.hypot(*scene.room_size_m)),
        )
        rows = [
            solid_row(pad.drawn, scene.mark_class, scene.mark_top, pad.panel_share)
            for pad in scene.pads
        ]
        rows += [solid_row(wall, OUTSIDE, OUTSIDE) for wall in scene.walls.values()]
        self._standing = _bodies([(item.shape, item.pose) for item in scene.placed], rows)
        self._movers = [scene.shape_of(mover) for mover in scene.movers]

    def cast(
        self,
        pose: CameraPose,
        movers: Sequence[MoverState] = (),
        rays: NDArray[np.float64] | None = None,
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Return class ids, (H, W) uint8, and depth along the optical axis, (H, W) float32, m.

        `rays` are (H, W, 2), where the pixels look, right and down at unit depth.
        """
        width_px, height_px = self.size_px
        ids = np.empty((height_px, width_px), dtype=np.uint8)
        depth_m = np.empty((height_px, width_px), dtype=np.float32)
        place, rays = _place(pose), self.rays if rays is None else rays
        cast_ground(place, rays, self._ground, ids, depth_m)
        moving = [(shape, state.pose) for shape, state in zip(self._movers, movers, strict=False)]
        for solids, meshes in (self._standing, _bodies(moving)):
            cast_solids((place, self._lens), rays, solids, ids, depth_m)
            cast_triangles((place, self._lens), rays, meshes, ids, depth_m)
        return ids, depth_m


def _bodies(placed: Sequence[tuple[Shape, Pose2D]], rows: Sequence[list[float]] = ()) -> Bodies:
    """Return shapes at their places, and rows of other solids, as the kernels take them."""
    solids, triangles, classes = list(rows), [np.empty((0, 3, 3))], [np.empty(0, np.uint8)]
    for shape, pose in placed:
        if shape.mesh is not None:
            flat = pose.points_to_world(shape.mesh[..., :2].reshape(-1, 2)).reshape(-1, 3, 2)
            triangles.append(np.concatenate([flat, shape.mesh[..., 2:]], axis=2))
            classes.append(np.full(len(flat), shape.class_id, np.uint8))
            continue
        for part in shape.parts:
            top_id = shape.top_class if part.roofed else shape.class_id
            solids.append(solid_row(part.at(pose), shape.class_id, top_id))
    table = np.array(solids, dtype=np.float64).reshape(-1, COLUMNS)
    return table, (np.concatenate(triangles), np.concatenate(classes))


def _place(pose: CameraPose) -> NDArray[np.float64]:
    """Return position, optical axis, and right and down of the image in the world, (4, 3)."""
    (ax, ay, az), (ux, uy, uz) = pose.axes()
    right = ay * uz - az * uy, az * ux - ax * uz, ax * uy - ay * ux
    return np.array([(pose.x_m, pose.y_m, pose.z_m), (ax, ay, az), right, (-ux, -uy, -uz)])
