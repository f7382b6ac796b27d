"""Parts of the model from a lab file: objects of its kinds, ground, walls and lamps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

from sim_bridge.twin import textures
from sim_bridge.twin.builder import Builder
from sim_bridge.twin.gl import mujoco
from sim_bridge.twin.meshes import (
    finer,
    merged,
    prism_mesh,
    triangle_mesh,
)
from sim_bridge.twin.placed import PlacedObject, Shape
from sim_bridge.twin.scene import FLOOR_M, Scene
from sim_bridge.twin.shapes import Part
from sim_bridge.twin.solids import Mesh, Solid
from sim_bridge.twin.surfaces import Paint, paint_of
from sim_bridge.twin.walls import ground_slabs, room_solids
from uav_bt.lab.classes import OUTSIDE
from uav_bt.lab.obj_file import pieces
from uav_bt.lab.room import GroundSection, Lamp, Surface, WallSection

_SHEET_M: Final = 0.001  # thickness of an upper face with another class or look
_LIT_M: Final = 0.5  # longest edge where lamps shine: light is computed at corners; chosen
_CONE_DEG: Final = 85.0  # half the opening of a lamp
_WALLS: Final = Surface(colour="#d6d5d2")
_FLOOR: Final = Surface(colour="#80807e")

Place = tuple[float, float, float]  # world x and y, and yaw counter-clockwise in radians


def add_object(builder: Builder, scene: Scene, item: PlacedObject) -> None:
    """Add an object of the scene."""
    x_m, y_m = item.spec.position_m
    place = (x_m, y_m, math.radians(item.spec.yaw_deg))
    add_shape(builder, scene, item.name, item.shape, place)


def add_shape(
    builder: Builder, scene: Scene, name: str, shape: Shape, place: Place, *, body: Any = None
) -> None:
    """Add a shape at a place of the world or of a body: a mesh for each look, and its contacts."""
    folder, fine = _folder(scene), bool(scene.lighting.lamps)
    for look, (surface, class_id) in _looks(shape).items():
        paint, material = paint_of(surface, folder), f"{shape.name}/{look}"
        builder.texture(material, paint.make)
        builder.show_mesh(
            f"{name}/{look}",
            partial(_drawn, shape, look, paint, fine=fine),
            centre_m=(place[0], place[1], 0.0),
            yaw_rad=place[2],
            material=material,
            class_id=class_id,
            body=body,
            shared=material,
        )
    if shape.mesh is not None:
        for number, piece in enumerate(pieces(shape.mesh)):
            builder.hit_hull(
                f"{name}/{number}",
                piece.reshape(-1, 3),
                shared=f"{shape.name}/hull-{number}",
                centre_m=(place[0], place[1], 0.0),
                yaw_rad=place[2],
                body=body,
            )
        return
    for number, part in enumerate(shape.parts):
        whole = name if len(shape.parts) == 1 else f"{name}/{number}"
        builder.hit(whole, _solid(part, part.base_m, part.top_m, place), body)


def _looks(shape: Shape) -> dict[str, tuple[Surface, int]]:
    """Return the looks of a shape with their classes."""
    kind = shape.kind
    looks = {"surface": (kind.surface, shape.class_id)}
    if kind.frame is not None:
        looks["frame"] = (kind.frame, shape.class_id)
    if _has_sheet(shape):
        looks["top"] = (kind.top or kind.surface, shape.top_class)
    return looks


def _has_sheet(shape: Shape) -> bool:
    other = shape.kind.top is not None or shape.top_class != shape.class_id
    return other and any(part.roofed for part in shape.parts)


def _drawn(shape: Shape, look: str, paint: Paint, *, fine: bool) -> Mesh:
    """Return all surfaces of one look in one mesh."""
    if shape.mesh is not None:
        return triangle_mesh(shape.mesh, paint.tile_m)
    sheet = _has_sheet(shape)
    solids = []
    for part in shape.parts:
        own = "frame" if part.frame and shape.kind.frame is not None else "surface"
        below_m = part.top_m - (_SHEET_M if part.roofed and sheet else 0.0)
        if own == look:
            solids.append(_solid(part, part.base_m, below_m))
        if part.roofed and sheet and look == "top":
            solids.append(_solid(part, below_m, part.top_m))
    mesh = merged(
        [solid.mesh(paint.tile_m) for solid in solids], [solid.centre_m for solid in solids]
    )
    return mesh if shape.round or not fine else finer(mesh, _LIT_M)


def _solid(part: Part, low_m: float, high_m: float, place: Place = (0.0, 0.0, 0.0)) -> Solid:
    cos, sin = math.cos(place[2]), math.sin(place[2])
    x_m, y_m = part.centre_m
    return Solid(
        half_m=(*part.half_m, (high_m - low_m) / 2),
        centre_m=(
            place[0] + cos * x_m - sin * y_m,
            place[1] + sin * x_m + cos * y_m,
            (low_m + high_m) / 2,
        ),
        yaw_rad=place[2],
        round=part.round,
    )


def add_ground(builder: Builder, scene: Scene, ground: GroundSection) -> None:
    """Add the ground of the lab."""
    plan, size_m = scene.ground_plan, scene.ground.size_m
    paint = paint_of(ground.surface, _folder(scene), size_m)
    builder.texture("ground", paint.make)
    fine = bool(scene.lighting.lamps)

    def mesh() -> Mesh:
        whole = prism_mesh(plan.corners_m, FLOOR_M, 0.0, paint.tile_m)
        return finer(whole, _LIT_M) if fine else whole

    builder.show_mesh(
        "ground/seen",
        mesh,
        centre_m=(0.0, 0.0, 0.0),
        yaw_rad=0.0,
        material="ground",
        class_id=scene.classes.ground,
    )
    if not plan.outline_m:
        half_m = (size_m[0] / 2, size_m[1] / 2, -FLOOR_M / 2)
        builder.hit("ground", Solid(half_m=half_m, centre_m=(0.0, 0.0, FLOOR_M / 2)))
        return
    for number, corners in enumerate(ground_slabs(scene)):
        name = f"ground/{number}"
        builder.hit_hull(name, corners, shared=name)


def add_walls(builder: Builder, scene: Scene, walls: WallSection) -> None:
    """Add walls, floor and ceiling of the lab."""
    folder, fine = _folder(scene), bool(scene.lighting.lamps)
    looks = {
        "wall": paint_of(walls.surface or _WALLS, folder),
        "floor": paint_of(walls.floor or _FLOOR, folder),
        "ceiling": Paint(make=partial(textures.plain, 0.92, 312), tile_m=(5.0, 5.0)),
    }
    for look, paint in looks.items():
        builder.texture(look, paint.make)
    for name, solid in room_solids(scene).items():
        look = name.split("-")[0]
        builder.show_mesh(
            f"{name}/seen",
            partial(_slab, solid, looks[look].tile_m, fine=fine),
            centre_m=solid.centre_m,
            yaw_rad=solid.yaw_rad,
            material=look,
            class_id=OUTSIDE,
        )
        builder.hit(name, solid)


def _slab(solid: Solid, tile_m: tuple[float, float], *, fine: bool) -> Mesh:
    mesh = solid.mesh(tile_m)
    return finer(mesh, _LIT_M) if fine else mesh


def add_lamps(builder: Builder, ambient: float, lamps: Sequence[Lamp]) -> None:
    """Add lamps that shine downwards, and the light without a direction."""
    everywhere = builder.spec.worldbody.add_light(name="ambient")  # that of a lamp would fade
    everywhere.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    everywhere.castshadow = False
    everywhere.ambient = (ambient,) * 3
    everywhere.diffuse = everywhere.specular = (0.0, 0.0, 0.0)
    for number, lamp in enumerate(lamps):
        light = builder.spec.worldbody.add_light(name=f"lamp-{number + 1}")
        light.type = mujoco.mjtLightType.mjLIGHT_SPOT
        light.pos, light.dir = lamp.position_m, (0.0, 0.0, -1.0)
        light.cutoff, light.exponent = _CONE_DEG, 1.0
        light.attenuation = (1.0, 0.0, 1.0 / lamp.reach_m**2)
        light.castshadow = False
        light.ambient = (0.0, 0.0, 0.0)
        light.diffuse = (lamp.brightness,) * 3
        light.specular = (0.0, 0.0, 0.0)


def _folder(scene: Scene) -> Path:
    return scene.place.lab.folder
