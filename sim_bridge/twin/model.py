"""MuJoCo model of a scene, with the class of each geom.

Separate geoms serve the camera (meshes with exact texture coordinates) and the contacts (plain
boxes). The geom of the drone is in a group that its camera never draws.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim_bridge.twin import textures
from sim_bridge.twin.body import CONTROL_STEP_S, HULL_HALF_M
from sim_bridge.twin.movers import MoverSpec, mover_names, roof_of
from sim_bridge.twin.objects import MAT_M, BoxSpec, Helipad, Vector2, Vector3, box_names
from sim_bridge.twin.scene import FLOOR_M, Lighting, Scene, obstacle_names
from sim_bridge.twin.solids import Solid, stacked, yaw_quaternion
from uav_bt.lab.roles import OUTSIDE
from uav_bt.plugins import make_mark_finder

HULL_MASS_KG = 0.32  # mass of the ANAFI
STEPS_PER_CONTROL = 2
PHYSICS_STEP_S = CONTROL_STEP_S / STEPS_PER_CONTROL  # short enough for contacts at 1 m/s

_SEEN_GROUP = 0
_HIT_GROUP = 3  # geom group that MuJoCo does not draw by default
_DRONE_GROUP = 4  # not drawn by default either: the camera never sees the drone

_PAINT_M = 0.0001  # height of the H above the pad, enough to be drawn over it


@dataclass(frozen=True, kw_only=True)
class LabModel:
    """A compiled scene."""

    model: Any  # mujoco.MjModel
    class_of_geom: NDArray[np.uint8]  # (number of geoms,): class id of each geom
    hull_geom: int
    hull_body: int
    obstacle_geoms: tuple[int, ...]  # contact geoms of boxes and movers


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
    for name, mover in zip(mover_names(scene.movers), scene.movers, strict=True):
        builder.mover(name, mover)
    for pad in scene.pads:
        builder.helipad(pad)
    builder.carpet(scene.ground.size_m)
    builder.room(scene.room_size_m)
    return builder.done()


class _Builder:
    def __init__(self, scene: Scene, *, drawn: bool) -> None:
        self._scene, self._drawn = scene, drawn
        self.spec = mujoco.MjSpec()
        self.spec.option.timestep = PHYSICS_STEP_S
        self.spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
        # Clipping: the near plane shows all that the hull almost touches, the far plane the room.
        self.spec.stat.extent = 8.0
        self.spec.stat.center = (0.0, 0.0, 1.0)
        self.spec.visual.map.znear = 0.02 / 8.0
        self.spec.visual.map.zfar = max(20.0, math.hypot(*scene.room_size_m)) / 8.0
        self.spec.visual.map.shadowclip = 1.0
        self.spec.visual.quality.shadowsize = 2048
        self.spec.visual.headlight.active = 0
        self._classes: dict[str, int] = {}
        self._drone()

    def done(self) -> LabModel:
        model = self.spec.compile()
        ids = np.zeros(model.ngeom, np.uint8)
        for name, class_id in self._classes.items():
            ids[model.geom(name).id] = class_id
        return LabModel(
            model=model,
            class_of_geom=ids,
            hull_geom=model.geom("drone").id,
            hull_body=model.body("drone").id,
            obstacle_geoms=tuple(model.geom(name).id for name in obstacle_names(self._scene)),
        )

    def _drone(self) -> None:
        body = self.spec.worldbody.add_body(name="drone")
        body.add_freejoint(name="drone")
        body.add_geom(
            name="drone",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=HULL_HALF_M,
            mass=HULL_MASS_KG,
            group=_DRONE_GROUP,
            rgba=(0.25, 0.26, 0.28, 1.0),
            friction=(0.8, 0.01, 0.001),
        )

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
            self._texture(kind, partial(textures.plain, value, seed))
        for name, (size, position) in slabs.items():
            slab = Solid(half_m=size, centre_m=position)
            kind = name.split("-")[0]
            self._show(f"{name}/seen", slab, material=kind, class_id=OUTSIDE, tile_m=(5.0, 5.0))
            self._hit(name, slab)

    def carpet(self, size_m: Vector2) -> None:
        self._texture("carpet", partial(textures.carpet, size_m))
        carpet = Solid(
            half_m=(size_m[0] / 2, size_m[1] / 2, -FLOOR_M / 2),
            centre_m=(0.0, 0.0, FLOOR_M / 2),
        )
        class_id = self._scene.classes.ground
        self._show("carpet/seen", carpet, material="carpet", class_id=class_id, tile_m=size_m)
        self._hit("carpet", carpet)

    def lights(self, lighting: Lighting) -> None:
        """Add the lamp, and a weak opposite lamp that shades the sides facing away from it."""
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
        self._texture("stripes", textures.stripes)
        picture = make_mark_finder(pad.mark).picture() if self._drawn else None
        self._texture("h", textures.helipad_top if picture is None else lambda: picture)
        whole, _, _ = stacked(pad.position_m, pad.drawn_size_m, math.radians(pad.yaw_deg))
        width, depth, height = pad.drawn_size_m
        panel_m = (pad.panel_share * width, pad.panel_share * depth)
        half_m, centre_m = (panel_m[0] / 2, panel_m[1] / 2, _PAINT_M), (*pad.position_m, height)
        panel = replace(whole, half_m=half_m, centre_m=centre_m)
        parts = (
            ("helipad/sides", whole, "stripes", self._scene.mark_class, (0.2, 0.2)),
            ("helipad/h", panel, "h", self._scene.mark_top, panel_m),
        )
        for name, solid, material, class_id, tile_m in parts:
            self._show(name, solid, material=material, class_id=class_id, tile_m=tile_m)
        if pad.size_m[2] >= MAT_M:  # on a flat mat the drone stands on the ground
            self._hit("helipad", whole)

    def box(self, name: str, box: BoxSpec) -> None:
        self._wrapped(name, stacked(box.position_m, box.size_m, math.radians(box.yaw_deg)), box)

    def mover(self, name: str, mover: MoverSpec) -> None:
        """Add a mover as a mocap body of MuJoCo, with its origin on the ground."""
        x, y = mover.path_m[0]
        body = self.spec.worldbody.add_body(name=name, mocap=True, pos=(x, y, 0.0))
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
            self._texture(paper, make)
            self._show(part, solid, material=paper, class_id=part_class, tile_m=tile_m, body=body)
        self._hit(name, whole, body)

    def _texture(self, name: str, make: Callable[[], NDArray[np.uint8]]) -> None:
        if not self._drawn or self.spec.material(name) is not None:
            return  # another box uses the same texture
        image = make()
        texture = self.spec.add_texture(
            name=name,
            type=mujoco.mjtTexture.mjTEXTURE_2D,
            width=image.shape[1],
            height=image.shape[0],
            nchannel=3,
        )
        # MuJoCo's v axis points up in the image, ours points down.
        texture.data = np.ascontiguousarray(image[::-1]).tobytes()
        material = self.spec.add_material(name=name, specular=0.0, shininess=0.0)
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name

    def _show(
        self,
        name: str,
        solid: Solid,
        *,
        material: str,
        class_id: int,
        tile_m: tuple[float, float],
        body: Any = None,
    ) -> None:
        """Add a visible geom without contacts to a body or to the world."""
        if not self._drawn:
            return
        vertices, faces, coordinates = solid.mesh(tile_m)
        mesh = self.spec.add_mesh(name=name)
        mesh.uservert = vertices.ravel()
        mesh.userface = faces.ravel()
        mesh.usertexcoord = coordinates.ravel()
        mesh.userfacetexcoord = faces.ravel()
        (body or self.spec.worldbody).add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=name,
            pos=solid.centre_m,
            quat=yaw_quaternion(solid.yaw_rad),
            material=material,
            group=_SEEN_GROUP,
            contype=0,
            conaffinity=0,
        )
        self._classes[name] = class_id

    def _hit(self, name: str, solid: Solid, body: Any = None) -> None:
        """Add an invisible geom with contacts to a body or to the world."""
        radius, _, half_height = solid.half_m
        kinds = mujoco.mjtGeom
        (body or self.spec.worldbody).add_geom(
            name=name,
            type=kinds.mjGEOM_CYLINDER if solid.round else kinds.mjGEOM_BOX,
            size=(radius, half_height, 0.0) if solid.round else solid.half_m,
            pos=solid.centre_m,
            quat=yaw_quaternion(solid.yaw_rad),
            group=_HIT_GROUP,
        )
