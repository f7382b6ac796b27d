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
from sim_bridge.plain.ground_rays import cast_ground
from sim_bridge.plain.mesh_rays import cast_triangles
from sim_bridge.plain.solid_rays import RAY_COLUMNS, cast_solids, solid_row
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.movers import MoverSpec, Point
from sim_bridge.twin.objects import BoxSpec
from sim_bridge.twin.placed import Shape
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.walls import wall_solids
from uav_bt.lab.classes import OUTSIDE
from uav_bt.lab.shipped import DEFAULT_LAB
from uav_bt.types import CameraModel, MoverState, Pose2D

_FAR_M: Final = 30.0  # depth of the room beyond the ground, unless the room is larger

Meshes = tuple[NDArray[np.float64], NDArray[np.uint8]]
"""Corners of triangles, (N, 3, 3) world metres, and their class ids, (N,)."""


class Caster:
    """Casts the rays of one scene.

    Args:
        scene: the lab.
        size_px: width and height of class maps and depth maps; any aspect gives the same view.
    """

    def __init__(self, scene: Scene, size_px: tuple[int, int]) -> None:
        self.size_px = size_px
        self.camera = anafi_camera(640, 360).resized(*size_px)
        self._lens = _lens(self.camera)
        self.rays = _rays(self._lens, size_px)
        self._scene = scene
        self.classes = scene.classes
        self.ground_id = self.classes.ground
        plan = scene.ground_plan
        edges = plan.area.edges[0] if plan.outline_m else ()
        self._ground = (
            np.array(scene.ground.size_m) / 2,
            np.array(edges, dtype=np.float64).reshape(-1, 4),
            self.ground_id,
            max(_FAR_M, math.hypot(*scene.room_size_m)),
        )
        solids = [
            solid_row((box.position_m, box.size_m, box.yaw_deg), self._class_ids(box))
            for box in scene.boxes
        ]
        solids += [
            solid_row(
                (pad.position_m, pad.drawn_size_m, pad.yaw_deg),
                (scene.mark_class, scene.mark_top),
                pad.panel_share,
            )
            for pad in scene.pads
        ]
        if scene.lab != DEFAULT_LAB:
            solids += _walls(scene)
        meshes = []
        for item in scene.placed:
            at = item.spec.position_m
            solids += _shape_rows(item.shape, at, item.spec.yaw_deg)
            meshes += _shape_meshes(item.shape, at, item.spec.yaw_deg)
        self._standing = np.array(solids).reshape(-1, RAY_COLUMNS)
        self._meshes = _together(meshes)

    def cast(
        self,
        pose: CameraPose,
        movers: Sequence[MoverState] = (),
        rays: NDArray[np.float64] | None = None,
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Return the view of a camera.

        Args:
            pose: pose of the camera.
            movers: states of the scene's movers, in its order.
            rays: (H, W, 2) where the pixels look, right and down at unit depth; default: `rays`.

        Returns:
            Class ids, (H, W) uint8, and depth along the optical axis, (H, W) float32, metres.
        """
        solids, meshes = self._standing, self._meshes
        if movers:
            rows, moved = self._moving(movers)
            solids = np.concatenate([solids, rows])
            meshes = _together([meshes, *moved]) if moved else meshes
        width_px, height_px = self.size_px
        ids = np.empty((height_px, width_px), dtype=np.uint8)
        depth_m = np.empty((height_px, width_px), dtype=np.float32)
        place, rays = _place(pose), self.rays if rays is None else rays
        cast_ground(place, rays, self._ground, ids, depth_m)
        cast_solids((place, self._lens), rays, solids, ids, depth_m)
        if len(meshes[0]):
            cast_triangles((place, self._lens), rays, meshes, ids, depth_m)
        return ids, depth_m

    def _class_ids(self, item: BoxSpec | MoverSpec) -> tuple[int, int]:
        """Return the classes of the sides and of the roof of a box or mover."""
        class_id = self._scene.class_of(item)
        return class_id, int(self.classes.top_of[class_id]) or class_id

    def _moving(self, movers: Sequence[MoverState]) -> tuple[NDArray[np.float64], list[Meshes]]:
        rows: list[list[float]] = []
        meshes: list[Meshes] = []
        for spec, state in zip(self._scene.movers, movers, strict=True):
            at = (state.pose.x_m, state.pose.y_m)
            if spec.kind is None:
                is_round, outline = spec.shape == "cylinder", (at, spec.size_m, spec.yaw_deg)
                rows.append(solid_row(outline, self._class_ids(spec), is_round=is_round))
            else:
                shape = self._scene.shape_of(spec.kind)
                rows += _shape_rows(shape, at, spec.yaw_deg)
                meshes += _shape_meshes(shape, at, spec.yaw_deg)
        return np.array(rows).reshape(-1, RAY_COLUMNS), meshes


def _shape_rows(shape: Shape, at_m: Point, yaw_deg: float) -> list[list[float]]:
    """Return the rows of a shape's boxes and cylinders; none of a mesh."""
    if shape.mesh is not None:
        return []
    place = Pose2D(x_m=at_m[0], y_m=at_m[1], yaw_rad=math.radians(yaw_deg))
    return [
        solid_row(
            (
                place.to_world(*part.centre_m),
                (2.0 * part.half_m[0], 2.0 * part.half_m[1], part.top_m),
                yaw_deg,
            ),
            (shape.class_id, shape.top_class if part.roofed else shape.class_id),
            is_round=part.round,
            base_m=part.base_m,
        )
        for part in shape.parts
    ]


def _shape_meshes(shape: Shape, at_m: Point, yaw_deg: float) -> list[Meshes]:
    """Return a mesh at its place in the world; none of another shape."""
    if shape.mesh is None:
        return []
    place = Pose2D(x_m=at_m[0], y_m=at_m[1], yaw_rad=math.radians(yaw_deg))
    triangles = shape.mesh.copy()
    triangles[..., :2] = place.points_to_world(triangles[..., :2].reshape(-1, 2)).reshape(-1, 3, 2)
    return [(triangles, np.full(len(triangles), shape.class_id, dtype=np.uint8))]


def _together(meshes: Sequence[Meshes]) -> Meshes:
    """Return meshes as one."""
    if not meshes:
        return np.empty((0, 3, 3)), np.empty(0, dtype=np.uint8)
    return np.concatenate([each[0] for each in meshes]), np.concatenate(
        [each[1] for each in meshes]
    )


def _walls(scene: Scene) -> list[list[float]]:
    return [
        solid_row(
            (
                wall.centre_m[:2],
                (2.0 * wall.half_m[0], 2.0 * wall.half_m[1], 2.0 * wall.half_m[2]),
                math.degrees(wall.yaw_rad),
            ),
            (OUTSIDE, OUTSIDE),
        )
        for wall in wall_solids(scene).values()
    ]


def _place(pose: CameraPose) -> NDArray[np.float64]:
    """Return position, optical axis, and right and down of the image in the world, (4, 3)."""
    (ax, ay, az), (ux, uy, uz) = pose.axes()
    right = ay * uz - az * uy, az * ux - ax * uz, ax * uy - ay * ux
    return np.array([(pose.x_m, pose.y_m, pose.z_m), (ax, ay, az), right, (-ux, -uy, -uz)])


def _rays(lens: NDArray[np.float64], size_px: tuple[int, int]) -> NDArray[np.float64]:
    """Return where pixels look, right and down at unit depth, (H, W, 2)."""
    columns, rows = np.meshgrid(np.arange(size_px[0]), np.arange(size_px[1]))
    return np.stack([(columns - lens[2]) / lens[0], (rows - lens[3]) / lens[1]], axis=-1)


def _lens(camera: CameraModel) -> NDArray[np.float64]:
    """Return focal lengths and middle, (4,), px."""
    return np.array([camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px])
