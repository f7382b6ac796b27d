"""MuJoCo model of a scene, with the class of each geom."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, Final

from sim_bridge.twin import textures
from sim_bridge.twin.builder import Builder, LabModel
from sim_bridge.twin.furniture import block
from sim_bridge.twin.gl import mujoco
from sim_bridge.twin.meshes import Mesh, block_mesh, prism_mesh, triangle_mesh
from sim_bridge.twin.movers import mover_names
from sim_bridge.twin.objects import MAT_M, Helipad
from sim_bridge.twin.room import FLOOR_M, ground_slabs, room_blocks
from sim_bridge.twin.scene import Lighting, Scene
from sim_bridge.twin.shapes import ORIGIN, Shape, Vector2
from sim_bridge.twin.surfaces import Paint, paint_of
from uav_bt.lab.classes import OUTSIDE
from uav_bt.lab.obj_file import pieces
from uav_bt.lab.surface import Surface
from uav_bt.plugins import make_mark_finder
from uav_bt.types import Pose2D
from uav_bt.types.arrays import Image
from uav_bt.types.ground import Block

_SHEET_M: Final = 0.001  # thickness of an upper face with another class or look
_PAINT_M: Final = 0.0001  # height of the H above the pad, enough to be drawn over it
_DETAIL: Final = Surface(colour="#33363b")  # handles, gaps, trousers
_CONE_DEG: Final = 85.0  # half the opening of a lamp
_STRIPES: Final = Paint(
    name="stripes", make=partial(textures.paper, "stripes"), tile_m=(textures.STRIPES_M,) * 2
)


def build_model(scene: Scene, *, drawn: bool = True) -> LabModel:
    """Compile a scene with the drone, whose free joint is the first seven coordinates.

    Textures and visible surfaces are left out of a model that is not `drawn`.
    """
    far_m = max(20.0, math.hypot(*scene.room_size_m))
    builder = Builder(drawn=drawn, far_m=far_m, lamps=bool(scene.lighting.lamps))
    _add_lights(builder, scene.lighting)
    # Geoms are drawn in this order. Things in front come first, because a software renderer
    # textures every pixel that no nearer surface covers yet.
    for item in scene.placed:
        _add_shape(builder, scene, item.name, item.shape, item.pose)
    names = mover_names(scene.movers)
    for name, mover in zip(names, scene.movers, strict=True):
        x_m, y_m = mover.path_m[0]  # a mocap body of MuJoCo, with its origin on the ground
        body = builder.spec.worldbody.add_body(name=name, mocap=True, pos=(x_m, y_m, 0.0))
        turned = replace(ORIGIN, yaw_rad=math.radians(mover.yaw_deg))
        _add_shape(builder, scene, name, scene.shape_of(mover), turned, body=body)
    if scene.helipad is not None:
        _add_helipad(builder, scene, scene.helipad)
    _add_ground(builder, scene)
    _add_room(builder, scene)
    return builder.done({*names, *(item.name for item in scene.placed if item.shape.class_id)})


def _add_lights(builder: Builder, lighting: Lighting) -> None:
    """Add the lamps, or one distant lamp and a weak opposite one that shades the sides."""
    kinds = mujoco.mjtLightType
    if not lighting.lamps:
        (x, y, z), share = lighting.direction, 1.0 - lighting.ambient
        for name, direction, ambient, diffuse in (
            ("lamp", (x, y, z), lighting.ambient, 0.85 * share),
            ("fill", (-1.5 * x, -1.5 * y, 0.5 * z), 0.0, 0.50 * share),
        ):
            sun = builder.light(name, kinds.mjLIGHT_DIRECTIONAL, ambient=ambient, diffuse=diffuse)
            sun.dir, sun.pos = direction, [-4.0 * value for value in direction]
            sun.castshadow = lighting.shadows and name == "lamp"
        return
    # The light without a direction, because that of a lamp would fade.
    builder.light("ambient", kinds.mjLIGHT_DIRECTIONAL, ambient=lighting.ambient, diffuse=0.0)
    for number, lamp in enumerate(lighting.lamps, start=1):
        light = builder.light(
            f"lamp-{number}", kinds.mjLIGHT_SPOT, ambient=0.0, diffuse=lamp.brightness
        )
        light.pos, light.dir = lamp.position_m, (0.0, 0.0, -1.0)
        light.cutoff, light.exponent = _CONE_DEG, 1.0
        light.attenuation = (1.0, 0.0, 1.0 / lamp.reach_m**2)


def _add_shape(
    builder: Builder, scene: Scene, name: str, shape: Shape, pose: Pose2D, *, body: Any = None
) -> None:
    """Add a shape at a place of the world or of a body: a mesh for each look, and its contacts."""
    for look, (surface, class_id, blocks) in _looks(shape).items():
        make: Callable[[Vector2], Mesh] = partial(block_mesh, blocks)
        if shape.mesh is not None:
            make = partial(triangle_mesh, shape.mesh)
        builder.show(
            f"{name}/{look}",
            make,
            paint_of(surface, scene.place.lab.folder),
            class_id,
            at=pose,
            body=body,
            shared=f"{shape.name}/{look}",
            curved=shape.kind.shape in ("cylinder", "mesh"),
        )
    if shape.mesh is None:
        for number, part in enumerate(shape.parts):
            builder.hit(name if len(shape.parts) == 1 else f"{name}/{number}", part.at(pose), body)
        return
    for number, piece in enumerate(pieces(shape.mesh)):
        asset = f"{shape.name}/hull-{number}"
        builder.hit_hull(f"{name}/{number}", piece, shared=asset, at=pose, body=body)


def _looks(shape: Shape) -> dict[str, tuple[Surface, int, list[Block]]]:
    """Return surface, class and parts of each look of a shape."""
    kind = shape.kind
    has_sheet = kind.top is not None or shape.top_class != shape.class_id
    looks: dict[str, tuple[Surface, int, list[Block]]]
    looks = {"surface": (kind.surface, shape.class_id, [])}
    if shape.mesh is not None:
        return looks
    looks["frame"] = (kind.frame or kind.surface, shape.class_id, [])
    looks["detail"] = (_DETAIL, shape.class_id, [])
    if has_sheet:
        looks["top"] = (kind.top or kind.surface, shape.top_class, [])
    for part in shape.parts:
        look = "surface" if part.look == "frame" and kind.frame is None else part.look
        below_m = part.top_m
        if part.roofed and has_sheet:
            below_m -= _SHEET_M
            looks["top"][2].append(replace(part, base_m=below_m))
        looks[look][2].append(replace(part, top_m=below_m))
    return {name: look for name, look in looks.items() if look[2]}


def _add_helipad(builder: Builder, scene: Scene, pad: Helipad) -> None:
    _show_block(builder, "mark/sides", pad.drawn, _STRIPES, scene.mark_class)
    outline, height_m = pad.drawn.footprint, pad.drawn.top_m
    half_m = (pad.panel_share * outline.half_x_m, pad.panel_share * outline.half_y_m)
    panel = block(half_m, height_m - _PAINT_M, height_m + _PAINT_M).at(outline)
    tile_m = (2.0 * half_m[0], 2.0 * half_m[1])
    paint = Paint(name="mark", make=partial(_picture, pad), tile_m=tile_m)
    _show_block(builder, "mark/h", panel, paint, scene.mark_top)
    if pad.size_m[2] >= MAT_M:  # on a flat mat the drone stands on the ground
        builder.hit("mark", pad.drawn)


def _picture(pad: Helipad) -> Image:
    picture = make_mark_finder(pad.mark).picture()
    return textures.helipad_top() if picture is None else picture


def _add_ground(builder: Builder, scene: Scene) -> None:
    section, ground = scene.room.ground, scene.ground
    surface = Surface(generator="carpet") if section is None else section.surface
    paint = paint_of(surface, scene.place.lab.folder, ground.size_m)
    if not ground.outline_m:
        whole = block((ground.size_m[0] / 2, ground.size_m[1] / 2), FLOOR_M, 0.0)
        _show_block(builder, "ground/seen", whole, paint, scene.classes.ground)
        builder.hit("ground", whole)
        return
    make = partial(prism_mesh, ground.outline_m, FLOOR_M, 0.0)
    builder.show("ground/seen", make, paint, scene.classes.ground)
    for number, corners in enumerate(ground_slabs(ground)):
        builder.hit_hull(f"ground/{number}", corners, shared=f"ground/{number}")


def _add_room(builder: Builder, scene: Scene) -> None:
    """Add floor, ceiling and walls."""
    walls, folder = scene.room.walls, scene.place.lab.folder
    greys = {"floor": (0.50, 310), "wall": (0.84, 311), "ceiling": (0.92, 312)}
    paints = {
        name: Paint(name=name, make=partial(textures.plain, *grey), tile_m=(5.0, 5.0))
        for name, grey in greys.items()
    }
    if walls is not None:
        paints["wall"] = paint_of(walls.surface or Surface(colour="#d6d5d2"), folder)
        paints["floor"] = paint_of(walls.floor or Surface(colour="#80807e"), folder)
    for name, slab in room_blocks(scene.room_size_m, scene.walls).items():
        _show_block(builder, f"{name}/seen", slab, paints[name.split("-")[0]], OUTSIDE)
        builder.hit(name, slab)


def _show_block(builder: Builder, name: str, solid: Block, paint: Paint, class_id: int) -> None:
    outline = solid.footprint
    own = block((outline.half_x_m, outline.half_y_m), solid.base_m, solid.top_m)
    builder.show(name, partial(block_mesh, [own]), paint, class_id, at=outline)
