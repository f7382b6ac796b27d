"""Builder of a MuJoCo model: the drone, textures, drawn surfaces and contacts.

Separate geoms serve the camera (meshes with exact texture coordinates) and the contacts (plain
boxes, cylinders and convex meshes). The drone's geom is in a group that its camera never draws.
The name of a contact is the part of its geom's name before the slash.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_bridge.twin.body import CONTROL_STEP_S, HULL_HALF_M
from sim_bridge.twin.gl import mujoco
from sim_bridge.twin.meshes import Mesh, finer
from sim_bridge.twin.shapes import ORIGIN, Vector2
from sim_bridge.twin.surfaces import Paint
from uav_bt.errors import InputError
from uav_bt.types import Pose2D
from uav_bt.types.ground import Block

HULL_MASS_KG = 0.32  # mass of the ANAFI
STEPS_PER_CONTROL = 2
PHYSICS_STEP_S = CONTROL_STEP_S / STEPS_PER_CONTROL  # short enough for contacts at 1 m/s
HIT_GROUP = 3  # geom group that MuJoCo does not draw by default

_SEEN_GROUP = 0
_DRONE_GROUP = 4  # not drawn by default either: the camera never sees the drone
_LIT_M = 0.5  # longest edge where lamps shine: light is computed at corners; chosen


@dataclass(frozen=True, kw_only=True)
class LabModel:
    """A compiled scene."""

    model: Any  # mujoco.MjModel
    class_of_geom: NDArray[np.uint8]  # (number of geoms,): class id of each geom
    hull_geom: int
    hull_body: int
    obstacle_geoms: tuple[int, ...] = ()  # contact geoms of obstacles

    def contact_name(self, geom: int) -> str:
        """Return the name in contacts of a geom: that of its object."""
        name: str = self.model.geom(geom).name
        return name.split("/", maxsplit=1)[0]


class Builder:
    """Builds a model with the drone; textures and visible surfaces only where it is `drawn`."""

    def __init__(self, *, drawn: bool, far_m: float, lamps: bool) -> None:
        self._drawn, self._lamps = drawn, lamps
        self.spec = mujoco.MjSpec()
        self.spec.option.timestep = PHYSICS_STEP_S
        self.spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
        # Clipping: the near plane shows all that the hull almost touches, the far plane the room.
        self.spec.stat.extent = 8.0
        self.spec.stat.center = (0.0, 0.0, 1.0)
        self.spec.visual.map.znear = 0.02 / 8.0
        self.spec.visual.map.zfar = far_m / 8.0
        self.spec.visual.map.shadowclip = 1.0
        self.spec.visual.quality.shadowsize = 2048
        self.spec.visual.headlight.active = 0
        self._classes: dict[str, int] = {}
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

    def done(self, obstacles: Collection[str]) -> LabModel:
        """Compile the model, in which objects and movers of these names are obstacles."""
        try:
            model = self.spec.compile()
        except ValueError as error:
            raise InputError(f"MuJoCo cannot build this scene: {error}") from error
        ids = np.zeros(model.ngeom, np.uint8)
        for name, class_id in self._classes.items():
            ids[model.geom(name).id] = class_id
        hull = model.geom("drone").id, model.body("drone").id
        lab = LabModel(model=model, class_of_geom=ids, hull_geom=hull[0], hull_body=hull[1])
        hit = np.flatnonzero(model.geom_group == HIT_GROUP).tolist()
        return replace(
            lab, obstacle_geoms=tuple(geom for geom in hit if lab.contact_name(geom) in obstacles)
        )

    def light(self, name: str, kind: mujoco.mjtLightType, *, ambient: float, diffuse: float) -> Any:
        """Add a light without shadows and highlights, and return it."""
        light = self.spec.worldbody.add_light(name=name)
        light.type, light.castshadow = kind, False
        light.ambient, light.diffuse = (ambient,) * 3, (diffuse,) * 3
        light.specular = (0.0, 0.0, 0.0)
        return light

    def _texture(self, paint: Paint) -> None:
        """Add the material of a paint, unless it is there."""
        if self.spec.material(paint.name) is not None:
            return
        image = paint.make()
        texture = self.spec.add_texture(
            name=paint.name,
            type=mujoco.mjtTexture.mjTEXTURE_2D,
            width=image.shape[1],
            height=image.shape[0],
            nchannel=3,
        )
        # MuJoCo's v axis points up in the image, ours points down.
        texture.data = np.ascontiguousarray(image[::-1]).tobytes()
        material = self.spec.add_material(name=paint.name, specular=0.0, shininess=0.0)
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = paint.name

    def show(
        self,
        name: str,
        make: Callable[[Vector2], Mesh],
        paint: Paint,
        class_id: int,
        *,
        at: Pose2D = ORIGIN,
        body: Any = None,
        shared: str | None = None,
        curved: bool = False,
    ) -> None:
        """Add a visible mesh without contacts to a body or to the world.

        `make` returns the mesh for the size of a tile. A mesh that several geoms show has a name.
        """
        if not self._drawn:
            return
        self._texture(paint)
        asset = shared or name
        if self.spec.mesh(asset) is None:
            made = make(paint.tile_m)
            vertices, faces, places = finer(made, _LIT_M) if self._lamps and not curved else made
            mesh = self.spec.add_mesh(name=asset)
            mesh.uservert = vertices.ravel()
            mesh.userface = faces.ravel()
            mesh.usertexcoord = places.ravel()
            mesh.userfacetexcoord = faces.ravel()
        (body or self.spec.worldbody).add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=asset,
            pos=(at.x_m, at.y_m, 0.0),
            quat=_quaternion(at),
            material=paint.name,
            group=_SEEN_GROUP,
            contype=0,
            conaffinity=0,
        )
        self._classes[name] = class_id

    def hit(self, name: str, block: Block, body: Any = None) -> None:
        """Add an invisible geom with contacts to a body or to the world."""
        outline, half_z_m = block.footprint, (block.top_m - block.base_m) / 2
        kinds = mujoco.mjtGeom
        size_m = (outline.half_x_m, outline.half_y_m, half_z_m)
        (body or self.spec.worldbody).add_geom(
            name=name,
            type=kinds.mjGEOM_CYLINDER if outline.round else kinds.mjGEOM_BOX,
            size=(outline.half_x_m, half_z_m, 0.0) if outline.round else size_m,
            pos=(outline.x_m, outline.y_m, (block.base_m + block.top_m) / 2),
            quat=_quaternion(outline),
            group=HIT_GROUP,
        )

    def hit_hull(
        self,
        name: str,
        vertices: NDArray[np.float64],
        *,
        shared: str,
        at: Pose2D = ORIGIN,
        body: Any = None,
    ) -> None:
        """Add an invisible geom with contacts: the convex hull of vertices, (..., 3)."""
        if self.spec.mesh(shared) is None:
            self.spec.add_mesh(name=shared).uservert = vertices.astype(np.float32).ravel()
        (body or self.spec.worldbody).add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=shared,
            pos=(at.x_m, at.y_m, 0.0),
            quat=_quaternion(at),
            group=HIT_GROUP,
        )


def _quaternion(pose: Pose2D) -> tuple[float, float, float, float]:
    """Return the quaternion (w, x, y, z) of a yaw angle."""
    return math.cos(pose.yaw_rad / 2), 0.0, 0.0, math.sin(pose.yaw_rad / 2)
