"""Class ids and depth of a view by ray casting: what a perfect network would see, without images.

Every pixel's ray is intersected with the ground, and with the boxes and cylinders whose outlines in
the image contain the pixel. The view is that of the twin's renderer at the same pose.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.movers import MoverSpec
from sim_bridge.twin.objects import BoxSpec
from sim_bridge.twin.scene import Scene
from uav_bt.compiled import compiled
from uav_bt.lab.roles import OUTSIDE
from uav_bt.types import CameraModel, MoverState

_MARGIN_PX: Final = 2.0  # of rays that look beside their pixel; chosen
_BESIDE_M: Final = 0.05  # a corner with less depth has no place in the image; chosen
_COLUMNS: Final = 11  # of the kernel's table of solids
_FAR_M: Final = 30.0  # depth of the room beyond the ground; farther than any lab is long


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
        self._ground_m = np.array(scene.ground.size_m) / 2
        self._scene = scene
        self.classes = scene.classes
        self.ground_id = self.classes.ground
        solids = [
            _solid((box.position_m, box.size_m, box.yaw_deg), self._papers(box))
            for box in scene.boxes
        ]
        solids += [
            _solid(
                (pad.position_m, pad.drawn_size_m, pad.yaw_deg),
                (scene.mark_class, scene.mark_top),
                pad.panel_share,
            )
            for pad in scene.pads
        ]
        self._standing = np.array(solids).reshape(-1, _COLUMNS)

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
        solids = self._standing
        if movers:
            moving = [
                self._moving(spec, state)
                for spec, state in zip(self._scene.movers, movers, strict=True)
            ]
            solids = np.concatenate([solids, moving])
        width_px, height_px = self.size_px
        ids = np.empty((height_px, width_px), dtype=np.uint8)
        depth_m = np.empty((height_px, width_px), dtype=np.float32)
        place, rays = _place(pose), self.rays if rays is None else rays
        _cast_ground(place, rays, (self._ground_m, self.ground_id), ids, depth_m)
        _cast_solids((place, self._lens), rays, solids, ids, depth_m)
        return ids, depth_m

    def _papers(self, item: BoxSpec | MoverSpec) -> tuple[int, int]:
        """Return the classes of the sides and of the roof of a box or mover."""
        class_id = self._scene.class_of(item)
        return class_id, int(self.classes.top_of[class_id])

    def _moving(self, spec: MoverSpec, state: MoverState) -> list[float]:
        outline = (state.pose.x_m, state.pose.y_m), spec.size_m, spec.yaw_deg
        return _solid(outline, self._papers(spec), is_round=spec.shape == "cylinder")


def _solid(
    outline: tuple[tuple[float, float], tuple[float, float, float], float],
    papers: tuple[int, int],
    share: float = 1.0,
    *,
    is_round: bool = False,
) -> list[float]:
    """Return the row of a solid in the kernel's table.

    Args:
        outline: its centre, world x and y, m; its size along its x and y and upwards, m; its yaw,
            degrees counter-clockwise.
        papers: classes of its sides and of the middle of its top.
        share: side of that middle over the side of the top; the rest has the class of the sides.
        is_round: whether it is a cylinder.
    """
    position_m, (length_m, width_m, height_m), yaw_deg = outline
    cos, sin = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    sizes_m = length_m / 2, width_m / 2, height_m
    return [*position_m, *sizes_m, cos, sin, *papers, share, float(is_round)]


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


@compiled(
    "void(float64[:, ::1], float64[:, :, ::1], Tuple((float64[::1], int64)), uint8[:, ::1],"
    " float32[:, ::1])"
)
def _cast_ground(
    place: NDArray[np.float64],
    rays: NDArray[np.float64],
    ground: tuple[NDArray[np.float64], int],
    ids: NDArray[np.uint8],
    depth_m: NDArray[np.float32],
) -> None:
    """Fill a view with the ground, and with what lies outside.

    Args:
        place: (4, 3) position of the lens, optical axis, and right and down of the image.
        rays: (H, W, 2) right and down at unit depth.
        ground: (2,) half sizes of the ground along x and y, and its class id.
        ids: (H, W) filled with class ids.
        depth_m: (H, W) filled with depth along the optical axis, m.
    """
    half_m, ground_id = ground
    for row in range(ids.shape[0]):
        for column in range(ids.shape[1]):
            u, v = rays[row, column]
            ids[row, column], depth_m[row, column] = OUTSIDE, _FAR_M
            down = place[1, 2] + u * place[2, 2] + v * place[3, 2]
            if down < 0.0:
                depth = -place[0, 2] / down
                x_m = place[0, 0] + depth * (place[1, 0] + u * place[2, 0] + v * place[3, 0])
                y_m = place[0, 1] + depth * (place[1, 1] + u * place[2, 1] + v * place[3, 1])
                depth_m[row, column] = min(depth, _FAR_M)
                if abs(x_m) <= half_m[0] and abs(y_m) <= half_m[1]:
                    ids[row, column] = ground_id


@compiled("UniTuple(int64, 4)(float64[:, ::1], float64[::1], float64[::1], UniTuple(int64, 2))")
def _frame(
    place: NDArray[np.float64],
    lens: NDArray[np.float64],
    solid: NDArray[np.float64],
    size_px: tuple[int, int],
) -> tuple[int, int, int, int]:
    """Return the rows and columns of the image that a solid may cover.

    Args:
        place: (4, 3) position of the lens, optical axis, and right and down of the image.
        lens: (4,) focal lengths and middle, px.
        solid: (11,) row of `_solid`.
        size_px: rows and columns of the image.

    Returns:
        First row, row after the last, first column, column after the last, with a margin for rays
        beside their pixels. No rows if the whole solid is behind the lens or beside the view; all
        if only a corner is beside or behind the lens.
    """
    x_m, y_m, half_x, half_y, high_m, cos, sin = solid[:7]
    rows, columns = size_px
    low_u, high_u, low_v, high_v = np.inf, -np.inf, np.inf, -np.inf
    # The largest distance of a corner from the lens's plane and into the view from each side.
    ahead = from_left = from_right = from_top = from_bottom = -np.inf
    beside = False
    for corner in range(8):
        along = half_x if corner & 1 else -half_x
        across = half_y if corner & 2 else -half_y
        dx = x_m + cos * along - sin * across - place[0, 0]
        dy = y_m + sin * along + cos * across - place[0, 1]
        dz = (high_m if corner & 4 else 0.0) - place[0, 2]
        depth = place[1, 0] * dx + place[1, 1] * dy + place[1, 2] * dz
        right = lens[0] * (place[2, 0] * dx + place[2, 1] * dy + place[2, 2] * dz)
        down = lens[1] * (place[3, 0] * dx + place[3, 1] * dy + place[3, 2] * dz)
        ahead = max(ahead, depth)
        from_left = max(from_left, right + (lens[2] + _MARGIN_PX) * depth)
        from_right = max(from_right, (columns - 1 + _MARGIN_PX - lens[2]) * depth - right)
        from_top = max(from_top, down + (lens[3] + _MARGIN_PX) * depth)
        from_bottom = max(from_bottom, (rows - 1 + _MARGIN_PX - lens[3]) * depth - down)
        if depth < _BESIDE_M:
            beside = True
            continue
        u, v = right / depth + lens[2], down / depth + lens[3]
        low_u, high_u = min(low_u, u), max(high_u, u)
        low_v, high_v = min(low_v, v), max(high_v, v)
    if min(ahead, from_left, from_right, from_top, from_bottom) < 0.0:
        return 0, 0, 0, 0
    if beside:
        return 0, rows, 0, columns
    return (
        math.ceil(max(low_v - _MARGIN_PX, 0.0)),
        math.floor(min(high_v + _MARGIN_PX, rows - 1.0)) + 1,
        math.ceil(max(low_u - _MARGIN_PX, 0.0)),
        math.floor(min(high_u + _MARGIN_PX, columns - 1.0)) + 1,
    )


@compiled("Tuple((float64, boolean))(float64[::1], float64[::1], float64[::1])")
def _met(
    solid: NDArray[np.float64], origin_m: NDArray[np.float64], ray: NDArray[np.float64]
) -> tuple[float, bool]:
    """Return the depth at which a ray enters a solid, and whether through its top.

    Args:
        solid: (11,) row of `_solid`.
        origin_m: (3,) the lens in the solid's own axes, from the middle of its base.
        ray: (3,) of unit depth, in the same axes.

    Returns:
        Depth along the optical axis, m, inf without a hit; whether the top was hit.
    """
    half_m, high_m = solid[2:4], solid[4]
    enter, leave = 0.0, np.inf
    if solid[10]:  # a cylinder
        square = ray[0] * ray[0] + ray[1] * ray[1]
        along = origin_m[0] * ray[0] + origin_m[1] * ray[1]
        beyond = origin_m[0] * origin_m[0] + origin_m[1] * origin_m[1] - half_m[0] * half_m[0]
        root = along * along - square * beyond
        if root < 0.0:
            return np.inf, False
        enter, leave = (-along - math.sqrt(root)) / square, (-along + math.sqrt(root)) / square
    else:
        for axis in range(2):
            near = (-half_m[axis] - origin_m[axis]) / ray[axis]
            far = (half_m[axis] - origin_m[axis]) / ray[axis]
            enter, leave = max(enter, min(near, far)), min(leave, max(near, far))
    base, roof = -origin_m[2] / ray[2], (high_m - origin_m[2]) / ray[2]
    through_top = roof < base and roof >= enter
    enter = max(enter, min(base, roof))
    leave = min(leave, max(base, roof))
    return (enter, through_top) if 0.0 < enter <= leave else (np.inf, False)


@compiled(
    "void(Tuple((float64[:, ::1], float64[::1])), float64[:, :, ::1], float64[:, ::1],"
    " uint8[:, ::1], float32[:, ::1])"
)
def _cast_solids(
    camera: tuple[NDArray[np.float64], NDArray[np.float64]],
    rays: NDArray[np.float64],
    solids: NDArray[np.float64],
    ids: NDArray[np.uint8],
    depth_m: NDArray[np.float32],
) -> None:
    """Draw boxes and cylinders into a view, where they are nearer than its depth.

    Args:
        camera: (4, 3) position of the lens, optical axis, and right and down of the image; and
            (4,) focal lengths and middle, px.
        rays: (H, W, 2) right and down at unit depth.
        solids: (S, 11) rows of `_solid`.
        ids: (H, W) class ids.
        depth_m: (H, W) depth along the optical axis, m.
    """
    place, lens = camera
    origin_m, ray = np.empty(3), np.empty(3)
    for index in range(len(solids)):
        solid = solids[index]
        cos, sin = solid[5], solid[6]
        dx, dy = place[0, 0] - solid[0], place[0, 1] - solid[1]
        origin_m[:] = cos * dx + sin * dy, cos * dy - sin * dx, place[0, 2]
        first_row, end_row, first_column, end_column = _frame(place, lens, solid, ids.shape)
        for row in range(first_row, end_row):
            for column in range(first_column, end_column):
                u, v = rays[row, column]
                x = place[1, 0] + u * place[2, 0] + v * place[3, 0]
                y = place[1, 1] + u * place[2, 1] + v * place[3, 1]
                z = place[1, 2] + u * place[2, 2] + v * place[3, 2]
                ray[0], ray[1], ray[2] = cos * x + sin * y, cos * y - sin * x, z
                depth, through_top = _met(solid, origin_m, ray)
                if depth >= depth_m[row, column]:
                    continue
                depth_m[row, column] = depth
                middle = through_top
                for axis in range(2):
                    met_m = origin_m[axis] + depth * ray[axis]
                    middle = middle and abs(met_m) <= solid[9] * solid[2 + axis]
                ids[row, column] = solid[8] if middle else solid[7]
