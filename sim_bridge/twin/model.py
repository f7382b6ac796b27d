"""MuJoCo model of a scene, with the class of each geom: the paper's lab and what labs add."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

from sim_bridge.twin import textures
from sim_bridge.twin.builder import Builder, LabModel
from sim_bridge.twin.gl import mujoco
from sim_bridge.twin.model_room import add_ground, add_lamps, add_object, add_shape, add_walls
from sim_bridge.twin.movers import MoverSpec, mover_names, roof_of
from sim_bridge.twin.objects import MAT_M, BoxSpec, Helipad, Vector2, Vector3, box_names
from sim_bridge.twin.scene import FLOOR_M, Lighting, Scene, obstacle_names
from sim_bridge.twin.solids import Solid, stacked
from uav_bt.lab.classes import OUTSIDE
from uav_bt.lab.shipped import DEFAULT_LAB
from uav_bt.plugins import make_mark_finder

_PAINT_M = 0.0001  # height of the H above the pad, enough to be drawn over it


def build_model(scene: Scene, *, drawn: bool = True) -> LabModel:
    """Compile a scene with the drone.

    Args:
        scene: the lab.
        drawn: whether a camera looks at it; if not, textures and visible surfaces are left out.

    Returns:
        The MuJoCo model; the free joint of the drone is the first seven coordinates.
    """
    builder = _Builder(scene, drawn=drawn)
    builder.lights(scene.lighting)
    # Geoms are drawn in this order. Things in front come first, because a software renderer
    # textures every pixel that no nearer surface covers yet.
    for name, box in zip(box_names(scene.boxes), scene.boxes, strict=True):
        builder.box(name, box)
    for item in scene.placed:
        add_object(builder, scene, item)
    for name, mover in zip(mover_names(scene.movers), scene.movers, strict=True):
        builder.mover(name, mover)
    for pad in scene.pads:
        builder.helipad(pad)
    own = scene.lab != DEFAULT_LAB
    if own and scene.room.ground is not None:
        add_ground(builder, scene, scene.room.ground)
    else:
        builder.carpet(scene.ground.size_m)
    if own and scene.room.walls is not None:
        add_walls(builder, scene, scene.room.walls)
    else:
        builder.room(scene.room_size_m)
    return builder.done(obstacle_names(scene))


class _Builder(Builder):
    def __init__(self, scene: Scene, *, drawn: bool) -> None:
        super().__init__(drawn=drawn, far_m=max(20.0, math.hypot(*scene.room_size_m)))
        self._scene = scene

    def room(self, size_m: Vector3) -> None:
        hx, hy, hz = (side / 2 for side in size_m)
        middle = hz + FLOOR_M
        slabs = {
            "floor": ((hx, hy, 0.05), (0.0, 0.0, FLOOR_M - 0.05)),
            "ceiling": ((hx, hy, 0.05), (0.0, 0.0, FLOOR_M + size_m[2] + 0.05)),
            "wall-east": ((0.05, hy, hz), (hx + 0.05, 0.0, middle)),
            "wall-west": ((0.05, hy, hz), (-hx - 0.05, 0.0, middle)),
            "wall-north": ((hx, 0.05, hz), (0.0, hy + 0.05, middle)),
            "wall-south": ((hx, 0.05, hz), (0.0, -hy - 0.05, middle)),
        }
        greys = {"floor": (0.50, 310), "wall": (0.84, 311), "ceiling": (0.92, 312)}
        for kind, (value, seed) in greys.items():
            self.texture(kind, partial(textures.plain, value, seed))
        for name, (size, position) in slabs.items():
            slab = Solid(half_m=size, centre_m=position)
            kind = name.split("-")[0]
            self.show(f"{name}/seen", slab, material=kind, class_id=OUTSIDE, tile_m=(5.0, 5.0))
            self.hit(name, slab)

    def carpet(self, size_m: Vector2) -> None:
        self.texture("carpet", partial(textures.carpet, size_m))
        ground = Solid(
            half_m=(size_m[0] / 2, size_m[1] / 2, -FLOOR_M / 2),
            centre_m=(0.0, 0.0, FLOOR_M / 2),
        )
        class_id = self._scene.classes.ground
        self.show("ground/seen", ground, material="carpet", class_id=class_id, tile_m=size_m)
        self.hit("ground", ground)

    def lights(self, lighting: Lighting) -> None:
        """Add the lamp, and a weak opposite lamp that shades the sides facing away from it."""
        if lighting.lamps:
            add_lamps(self, lighting.ambient, lighting.lamps)
            return
        x, y, z = lighting.direction
        share = 1.0 - lighting.ambient
        lamps = {
            "lamp": ((x, y, z), lighting.ambient, 0.85 * share, lighting.shadows),
            "fill": ((-1.5 * x, -1.5 * y, 0.5 * z), 0.0, 0.50 * share, False),
        }
        for name, (direction, ambient, diffuse, shadows) in lamps.items():
            light = self.spec.worldbody.add_light(name=name)
            light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
            light.dir = direction
            light.pos = [-4.0 * value for value in direction]
            light.castshadow = shadows
            light.ambient = (ambient,) * 3
            light.diffuse = (diffuse,) * 3
            light.specular = (0.0, 0.0, 0.0)

    def helipad(self, pad: Helipad) -> None:
        self.texture("stripes", textures.stripes)
        picture = make_mark_finder(pad.mark).picture() if self.drawn else None
        self.texture("h", textures.helipad_top if picture is None else lambda: picture)
        whole, _, _ = stacked(pad.position_m, pad.drawn_size_m, math.radians(pad.yaw_deg))
        width, depth, height = pad.drawn_size_m
        panel_m = (pad.panel_share * width, pad.panel_share * depth)
        half_m, centre_m = (panel_m[0] / 2, panel_m[1] / 2, _PAINT_M), (*pad.position_m, height)
        panel = replace(whole, half_m=half_m, centre_m=centre_m)
        parts = (
            ("mark/sides", whole, "stripes", self._scene.mark_class, (0.2, 0.2)),
            ("mark/h", panel, "h", self._scene.mark_top, panel_m),
        )
        for name, solid, material, class_id, tile_m in parts:
            self.show(name, solid, material=material, class_id=class_id, tile_m=tile_m)
        if pad.size_m[2] >= MAT_M:  # on a flat mat the drone stands on the ground
            self.hit("mark", whole)

    def box(self, name: str, box: BoxSpec) -> None:
        self._wrapped(name, stacked(box.position_m, box.size_m, math.radians(box.yaw_deg)), box)

    def mover(self, name: str, mover: MoverSpec) -> None:
        """Add a mover as a mocap body of MuJoCo, with its origin on the ground."""
        x, y = mover.path_m[0]
        body = self.spec.worldbody.add_body(name=name, mocap=True, pos=(x, y, 0.0))
        if mover.kind is not None:
            place = (0.0, 0.0, math.radians(mover.yaw_deg))
            add_shape(self, self._scene, name, self._scene.shape_of(mover.kind), place, body=body)
            return
        is_round, yaw_rad = mover.shape == "cylinder", math.radians(mover.yaw_deg)
        parts = stacked((0.0, 0.0), mover.size_m, yaw_rad, is_round=is_round)
        self._wrapped(name, parts, mover, body)

    def _wrapped(
        self,
        name: str,
        parts: tuple[Solid, Solid, Solid],
        item: BoxSpec | MoverSpec,
        body: Any = None,
    ) -> None:
        """Add a body in printed paper: its contact geom, its sides and its roof."""
        whole, sides, sheet = parts
        pattern, roof = item.pattern, roof_of(item.pattern)
        side, top = partial(textures.side, pattern), partial(textures.roof, roof)
        class_id = self._scene.class_of(item)
        papers = (
            (f"{name}/side", sides, f"box-{pattern}", side, class_id),
            (f"{name}/roof", sheet, f"roof-{roof}", top, int(self._scene.classes.top_of[class_id])),
        )
        tile_m = (textures.TILE_M, textures.TILE_M)
        for part, solid, paper, make, part_class in papers:
            self.texture(paper, make)
            self.show(part, solid, material=paper, class_id=part_class, tile_m=tile_m, body=body)
        self.hit(name, whole, body)
