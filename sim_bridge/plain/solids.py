"""Solids of a lab that the drone without images can touch: those of the twin's contact geoms."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_bridge.plain.gaps import GAP_COLUMNS
from sim_bridge.plain.hulls import facets_of
from sim_bridge.twin.movers import mover_names
from sim_bridge.twin.objects import MAT_M, Vector2, Vector3, box_names
from sim_bridge.twin.placed import Shape
from sim_bridge.twin.scene import FLOOR_M, Scene
from sim_bridge.twin.walls import ground_slabs, room_solids
from uav_bt.lab.obj_file import pieces
from uav_bt.types import Pose2D

_THICK_M = 0.1  # of floor, walls and ceiling


class MovingPart(NamedTuple):
    """A solid that belongs to a mover."""

    mover: int  # its number
    beside_m: Vector2  # place of the solid's axis from the mover, world axes


@dataclass(frozen=True, kw_only=True)
class Solids:
    """The solids of a scene: first boxes, objects and movers, in its order."""

    names: tuple[str, ...]  # in contacts, of each row
    table: NDArray[np.float64]  # (S, GAP_COLUMNS), a row each
    facets: NDArray[np.float64]  # (F, 4, 3) of all convex hulls
    obstacles: int  # number of rows of boxes, objects and movers
    first_mover: int  # row
    moving: tuple[MovingPart, ...]  # of the rows from `first_mover` to `obstacles`


def solids_of(scene: Scene) -> Solids:
    """Return the solids of a scene."""
    rows = _Rows()
    for name, box in zip(box_names(scene.boxes), scene.boxes, strict=True):
        rows.add(name, _row(box.position_m, box.size_m, box.yaw_deg))
    for item in scene.placed:
        rows.add_shape(item.name, item.shape, item.spec.position_m, item.spec.yaw_deg)
    first_mover, moving = len(rows.names), []
    for number, (name, mover) in enumerate(
        zip(mover_names(scene.movers), scene.movers, strict=True)
    ):
        at_m, before = mover.path_m[0], len(rows.names)
        if mover.kind is None:
            row = _row(at_m, mover.size_m, mover.yaw_deg, is_round=mover.shape == "cylinder")
            rows.add(name, row)
        else:
            rows.add_shape(name, scene.shape_of(mover.kind), at_m, mover.yaw_deg)
        for x_m, y_m, *_ in rows.table[before:]:
            moving.append(MovingPart(number, (x_m - at_m[0], y_m - at_m[1])))
    obstacles = len(rows.names)
    for pad in scene.pads:
        if pad.size_m[2] >= MAT_M:
            rows.add("mark", _row(pad.position_m, pad.drawn_size_m, pad.yaw_deg))
    _add_ground(rows, scene)
    _add_room(rows, scene)
    return Solids(
        names=tuple(rows.names),
        table=np.array(rows.table).reshape(-1, GAP_COLUMNS),
        facets=np.concatenate([np.empty((0, 4, 3)), *rows.facets]),
        obstacles=obstacles,
        first_mover=first_mover,
        moving=tuple(moving),
    )


class _Rows:
    """The table while it is filled."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.table: list[list[float]] = []
        self.facets: list[NDArray[np.float64]] = []
        self._hulls: dict[tuple[str, int], list[float]] = {}  # first facet and their number

    def add(self, name: str, row: list[float]) -> None:
        self.names.append(name)
        self.table.append(row)

    def add_shape(self, name: str, shape: Shape, at_m: Vector2, yaw_deg: float) -> None:
        """Add the boxes and cylinders of a shape, or the convex hulls of the pieces of a mesh."""
        place = Pose2D(x_m=at_m[0], y_m=at_m[1], yaw_rad=math.radians(yaw_deg))
        hulls = [] if shape.mesh is None else pieces(shape.mesh)
        for number, part in enumerate(shape.parts):
            size_m = 2.0 * part.half_m[0], 2.0 * part.half_m[1], part.top_m - part.base_m
            centre_m = place.to_world(*part.centre_m)
            row = _row(centre_m, size_m, yaw_deg, base_m=part.base_m, is_round=part.round)
            if hulls:
                points_m = hulls[number].reshape(-1, 3) - (*part.centre_m, 0.0)
                row[-2:] = self._hull((shape.name, number), points_m)
            self.add(name, row)

    def add_hull(self, name: str, points_m: NDArray[np.float64]) -> None:
        """Add the convex hull of points, (N, 3), in the world."""
        low, high = points_m.min(axis=0), points_m.max(axis=0)
        x_m, y_m, _ = (low + high) / 2
        row = _row((x_m, y_m), tuple(high - low), base_m=low[2])
        row[-2:] = self._hull((name, len(self.names)), points_m - (x_m, y_m, 0.0))
        self.add(name, row)

    def _hull(self, key: tuple[str, int], points_m: NDArray[np.float64]) -> list[float]:
        """Return the first facet of a hull and their number; a hull of one key is kept once."""
        if key not in self._hulls:
            facets = facets_of(points_m)
            self._hulls[key] = [float(sum(map(len, self.facets))), float(len(facets))]
            self.facets.append(facets)
        return self._hulls[key]


def _add_ground(rows: _Rows, scene: Scene) -> None:
    slabs = ground_slabs(scene)
    for corners in slabs:
        rows.add_hull("ground", corners)
    if not slabs:
        rows.add("ground", _row((0.0, 0.0), (*scene.ground.size_m, -FLOOR_M), base_m=FLOOR_M))


def _add_room(rows: _Rows, scene: Scene) -> None:
    stated = room_solids(scene)
    for name, solid in stated.items():
        half_x_m, half_y_m, half_z_m = solid.half_m
        x_m, y_m, z_m = solid.centre_m
        size_m, yaw_deg = (2 * half_x_m, 2 * half_y_m, 2 * half_z_m), math.degrees(solid.yaw_rad)
        rows.add(name, _row((x_m, y_m), size_m, yaw_deg, base_m=z_m - half_z_m))
    if stated:
        return
    long_m, wide_m, high_m = scene.room_size_m
    flat_m = (long_m, wide_m, _THICK_M)
    rows.add("floor", _row((0.0, 0.0), flat_m, base_m=FLOOR_M - _THICK_M))
    rows.add("ceiling", _row((0.0, 0.0), flat_m, base_m=FLOOR_M + high_m))
    for name, x, y in (("east", 1, 0), ("west", -1, 0), ("north", 0, 1), ("south", 0, -1)):
        at_m = x * (long_m + _THICK_M) / 2, y * (wide_m + _THICK_M) / 2
        size_m = (_THICK_M, wide_m, high_m) if x else (long_m, _THICK_M, high_m)
        rows.add(f"wall-{name}", _row(at_m, size_m, base_m=FLOOR_M))


def _row(
    position_m: Vector2,
    size_m: Vector3,
    yaw_deg: float = 0.0,
    *,
    base_m: float = 0.0,
    is_round: bool = False,
) -> list[float]:
    """Return the row of an upright box or cylinder."""
    yaw_rad = math.radians(yaw_deg)
    sizes_m = size_m[0] / 2, size_m[1] / 2, base_m, base_m + size_m[2]
    turn = math.cos(yaw_rad), math.sin(yaw_rad)
    return [*position_m, *sizes_m, *turn, float(is_round), 0.0, 0.0]
