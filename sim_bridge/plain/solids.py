"""Solids of a lab that the drone without images can touch: those of the twin's contact geoms."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_bridge.plain.gaps import COLUMNS
from sim_bridge.twin.objects import MAT_M, Vector2, Vector3
from sim_bridge.twin.scene import FLOOR_M, Scene, obstacle_names

_THICK_M = 0.1  # of floor, walls and ceiling


@dataclass(frozen=True, kw_only=True)
class Solids:
    """The solids of a scene: first boxes and movers, in its order."""

    names: tuple[str, ...]  # in contacts
    table: NDArray[np.float64]  # (S, COLUMNS), a row each
    obstacles: int  # number of boxes and movers
    first_mover: int  # row


def solids_of(scene: Scene) -> Solids:
    """Return the solids of a scene."""
    rows = [_row(box.position_m, box.size_m, box.yaw_deg) for box in scene.boxes]
    for mover in scene.movers:
        row = _row(mover.path_m[0], mover.size_m, mover.yaw_deg)
        rows.append([*row[:-1], float(mover.shape == "cylinder")])
    pads = [pad for pad in scene.pads if pad.size_m[2] >= MAT_M]
    rows += [_row(pad.position_m, pad.drawn_size_m, pad.yaw_deg) for pad in pads]
    ground_m, (long_m, wide_m, high_m) = scene.ground.size_m, scene.room_size_m
    room = {
        "carpet": _row((0.0, 0.0), (*ground_m, -FLOOR_M), base_m=FLOOR_M),
        "floor": _row((0.0, 0.0), (long_m, wide_m, _THICK_M), base_m=FLOOR_M - _THICK_M),
        "ceiling": _row((0.0, 0.0), (long_m, wide_m, _THICK_M), base_m=FLOOR_M + high_m),
    }
    for name, x, y in (("east", 1, 0), ("west", -1, 0), ("north", 0, 1), ("south", 0, -1)):
        at_m = x * (long_m + _THICK_M) / 2, y * (wide_m + _THICK_M) / 2
        size_m = (_THICK_M, wide_m, high_m) if x else (long_m, _THICK_M, high_m)
        room[f"wall-{name}"] = _row(at_m, size_m, base_m=FLOOR_M)
    return Solids(
        names=(*obstacle_names(scene), *("helipad" for _ in pads), *room),
        table=np.array([*rows, *room.values()]).reshape(-1, COLUMNS),
        obstacles=len(scene.boxes) + len(scene.movers),
        first_mover=len(scene.boxes),
    )


def _row(
    position_m: Vector2, size_m: Vector3, yaw_deg: float = 0.0, *, base_m: float = 0.0
) -> list[float]:
    """Return the row of an upright box."""
    yaw_rad = math.radians(yaw_deg)
    sizes_m = size_m[0] / 2, size_m[1] / 2, base_m, base_m + size_m[2]
    return [*position_m, *sizes_m, math.cos(yaw_rad), math.sin(yaw_rad), 0.0]
